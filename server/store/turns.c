/* turns.c -- whose turn it is: the next job to start, what users have used.
 *
 * Between users the one with the least recent CPU time goes first, a second of which counts half
 * after HALF_LIFE_SEC. What is stored is w = log2 of the sum over all charges of
 * seconds * 2^(time / HALF_LIFE_SEC): it does not change while time passes, so users are compared
 * without looking at the clock, and a clock set wrong for a day misjudges a day's work by a factor
 * of two at most. A charge that cannot be entered is kept in
 * memory and entered as soon as it can be. */
#include <math.h>

#include "common/mem.h"
#include "server/store/internal.h"
#include "server/store/store.h"

#define HALF_LIFE_SEC 86400.0

/* log2(2^a + 2^b) */
static double add_weights(double a, double b) { return fmax(a, b) + log2(1.0 + exp2(-fabs(a - b))); }

/* Keeps a charge for later. The store is locked. */
static void owe(struct store *store, int64_t owner_id, double weight) {
    for (size_t i = 0; i < store->unpaid_count; i++)
        if (store->unpaid[i].owner_id == owner_id) {
            store->unpaid[i].weight = add_weights(store->unpaid[i].weight, weight);
            return;
        }
    store->unpaid = mem_realloc_array(store->unpaid, store->unpaid_count + 1, sizeof *store->unpaid);
    store->unpaid[store->unpaid_count++] = (struct unpaid){owner_id, weight};
}

/* Inside a transaction. */
static enum status pay(struct store *store, const struct unpaid *u, struct error *err) {
    sqlite3_stmt *stmt;
    bool found = false;
    double weight = u->weight;
    enum status status =
        sql_first(&store->sql, &stmt, &found, err, "SELECT weight FROM usage WHERE owner_id = ?", "i", u->owner_id);
    if (found) {
        weight = add_weights(weight, sqlite3_column_double(stmt, 0));
        sqlite3_reset(stmt);
    }
    return status == STATUS_OK
               ? sql_run(&store->sql, err, "INSERT OR REPLACE INTO usage (owner_id, weight) VALUES (?, ?)", "id",
                         u->owner_id, weight)
               : status;
}

enum status store_usage_pay(struct store *store, struct error *err) {
    store_lock(store);
    bool is_none = store->unpaid_count == 0;
    store_unlock(store);
    enum status status = is_none ? STATUS_OK : store_begin(store, err);
    if (is_none || status != STATUS_OK)
        return status;
    size_t count = store->unpaid_count; /* 0 where another thread has paid meanwhile */
    struct unpaid *unpaid = store->unpaid;
    store->unpaid = NULL;
    store->unpaid_count = 0;
    for (size_t i = 0; i < count && status == STATUS_OK; i++)
        status = pay(store, &unpaid[i], err);
    status = store_end(store, status, STORE_NOTHING_CHANGED, err);
    store_lock(store);
    for (size_t i = 0; i < count && status != STATUS_OK; i++)
        owe(store, unpaid[i].owner_id, unpaid[i].weight);
    store_unlock(store);
    mem_free(unpaid);
    return status;
}

enum status store_usage_add(struct store *store, int64_t owner_id, double cpu_sec, struct error *err) {
    if (!(cpu_sec > 0.0))
        return STATUS_OK;
    store_lock(store);
    owe(store, owner_id, log2(cpu_sec) + (double)store_now_ms() * 1e-3 / HALF_LIFE_SEC);
    store_unlock(store);
    return store_usage_pay(store, err);
}

enum status store_job_next(struct store *store, int user_max_running, int64_t *id, struct error *err) {
    store_lock(store);
    enum status status = sql_int(&store->sql, 0, id, err,
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
    return status == STATUS_OK && *id == 0 ? error_set(err, STATUS_NOT_FOUND, "no job waits to be run") : status;
}

enum status store_queue_check(struct store *store, int64_t owner_id, const struct count_limits *limits,
                              struct error *err) {
    int64_t queued;
    enum status status =
        sql_int(&store->sql, 0, &queued, err, "SELECT count(*) FROM jobs WHERE state = ?", "n", (int)JOB_QUEUED);
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
