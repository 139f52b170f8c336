/* turns.c -- whose turn it is: the next job to start, what users have used.
 *
 * Between users the one with the least recent CPU time goes first, a second of which counts half
 * after HALF_LIFE_SEC. What is stored is w = log2 of the sum over all charges of
 * seconds * 2^(time / HALF_LIFE_SEC): it does not change while time passes, so users are compared
 * without looking at the clock, and a clock set wrong for a day misjudges a day's work by a factor
 * of two at most. */
#include <math.h>

#include "server/store/internal.h"
#include "server/store/store.h"

#define HALF_LIFE_SEC 86400.0

enum status store_usage_add(struct store *store, int64_t owner_id, double cpu_sec, struct error *err) {
    sqlite3_stmt *stmt;
    bool found = false;
    double before = 0.0;
    if (!(cpu_sec > 0.0))
        return STATUS_OK;
    double weight = log2(cpu_sec) + (double)store_now_ms() * 1e-3 / HALF_LIFE_SEC;
    enum status status = store_begin(store, err);
    if (status != STATUS_OK)
        return status;
    status = sql_first(&store->sql, &stmt, &found, err, "SELECT weight FROM usage WHERE owner_id = ?", "i",
                       owner_id);
    if (found) {
        before = sqlite3_column_double(stmt, 0);
        sqlite3_reset(stmt);
        weight = fmax(weight, before) + log2(1.0 + exp2(-fabs(weight - before)));
    }
    if (status == STATUS_OK)
        status = sql_run(&store->sql, err,
                         "INSERT OR REPLACE INTO usage (owner_id, weight) VALUES (?, ?)", "id",
                         owner_id, weight);
    return store_end(store, status, STORE_NOTHING_CHANGED, err);
}

enum status store_job_next(struct store *store, int user_max_running, int64_t *id,
                           struct error *err) {
    store_lock(store);
    enum status status =
        sql_int(&store->sql, 0, id, err,
                "WITH busy (user_id, count) AS"
                " (SELECT owner_id, count(*) FROM jobs WHERE state = ?1 GROUP BY owner_id)"
                "SELECT jobs.id FROM jobs JOIN scenes ON scenes.id = scene_id"
                " LEFT JOIN busy ON busy.user_id = jobs.owner_id"
                " LEFT JOIN usage ON usage.owner_id = jobs.owner_id"
                " WHERE jobs.state = ?2 AND scenes.state >= ?3"
                "  AND (?4 = 0 OR jobs.owner_id = 0 OR ifnull(busy.count, 0) < ?4)"
                " ORDER BY usage.weight IS NOT NULL, usage.weight, jobs.owner_id,"
                "  priority DESC, turn LIMIT 1",
                "nnnn", (int)JOB_RUNNING, (int)JOB_QUEUED, (int)SCENE_READY, user_max_running);
    store_unlock(store);
    return status == STATUS_OK && *id == 0
               ? error_set(err, STATUS_NOT_FOUND, "no job waits to be run")
               : status;
}

enum status store_queue_check(struct store *store, int64_t owner_id, const struct count_limits *limits,
                              struct error *err) {
    int64_t queued;
    enum status status = sql_int(&store->sql, 0, &queued, err, "SELECT count(*) FROM jobs WHERE state = ?", "n",
                                 (int)JOB_QUEUED);
    if (status == STATUS_OK && (uint64_t)queued >= limits->all)
        return error_set(err, STATUS_LIMIT, "%lld jobs are queued already, the limit is %zu", (long long)queued,
                         limits->all);
    if (status != STATUS_OK || limits->one_user == 0 || owner_id == 0)
        return status;
    status = sql_int(&store->sql, 0, &queued, err, "SELECT count(*) FROM jobs WHERE owner_id = ? AND state = ?", "in",
                     owner_id, (int)JOB_QUEUED);
    if (status == STATUS_OK && (uint64_t)queued >= limits->one_user)
        status = error_set(err, STATUS_LIMIT, "%lld of your jobs are queued already, the limit is %zu",
                           (long long)queued, limits->one_user);
    return status;
}
