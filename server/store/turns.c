/* turns.c -- whose turn it is: the next job to start, by what users have used of late (usage.c). */
#include "server/store/internal.h"
#include "server/store/store.h"

/* Whether a job is in the lane: ?5 the cost of a small render at the most, ?6 which lane. */
#define IN_LANE "((jobs.kind = 1 AND jobs.cost > 0 AND jobs.cost <= ?5) = ?6)"

/* Where the next attempt of a job must run; "": anywhere. Renders run here but for their parts. */
#define OPEN_PARTS(job) "EXISTS (SELECT 1 FROM parts WHERE job_id = " job " AND parts.state = 0)"
#define MUST_RUN_ON "iif(jobs.kind = 0 OR " OPEN_PARTS("jobs.id") ", jobs.executor, '" JOB_EXECUTOR_HERE "')"

enum status store_job_next(struct store *store, int user_max_running, const struct job_lane *lane, int64_t *id,
                           struct error *err) {
    const struct job_lane only = {0}, *l = lane ? lane : &only;
    store_lock(store);
    enum status status =
        sql_int(&store->sql, 0, id, err,
                "WITH busy (user_id, count) AS"
                " (SELECT owner_id, count(*) FROM attempts JOIN jobs ON jobs.id = attempts.job_id"
                " WHERE attempts.phase = 1 AND " IN_LANE " GROUP BY owner_id)"
                "SELECT jobs.id FROM jobs LEFT JOIN scenes ON scenes.id = scene_id"
                " LEFT JOIN busy ON busy.user_id = jobs.owner_id"
                " LEFT JOIN usage ON usage.owner_id = jobs.owner_id"
                " WHERE jobs.state IN (?1, ?2) AND (kind = 1 OR scenes.state >= ?3) AND " IN_LANE
                "  AND (jobs.state = ?2 OR (jobs.wanted = 0 AND EXISTS (SELECT 1 FROM parts WHERE job_id = jobs.id)"
                "   AND " NEXT_PART("jobs.id") " IS NOT NULL))"
                                               "  AND (?4 = 0 OR jobs.owner_id = 0 OR ifnull(busy.count, 0) < ?4)"
                                               "  AND (?7 IS NULL OR (?8 AND " MUST_RUN_ON
                                               " = '') OR instr(?7, ' ' || " MUST_RUN_ON " || ' '))"
                                               " ORDER BY usage.weight IS NOT NULL, usage.weight, jobs.owner_id,"
                                               "  priority DESC, turn LIMIT 1",
                "nnnndntn", (int)JOB_RUNNING, (int)JOB_QUEUED, (int)SCENE_READY, user_max_running, l->small_cost,
                (int)l->is_small, l->executors, (int)l->anywhere);
    store_unlock(store);
    return status == STATUS_OK && *id == 0 ? error_set(err, STATUS_NOT_FOUND, "no job waits to be run") : status;
}

enum status store_job_executor(struct store *store, int64_t id, char **executor, struct error *err) {
    sqlite3_stmt *stmt;
    bool found = false;
    *executor = NULL;
    store_lock(store);
    enum status status =
        sql_first(&store->sql, &stmt, &found, err, "SELECT " MUST_RUN_ON " FROM jobs WHERE id = ?", "i", id);
    if (found) {
        *executor = sql_dup(stmt, 0);
        sqlite3_reset(stmt);
    }
    store_unlock(store);
    return status == STATUS_OK && !found ? error_set(err, STATUS_NOT_FOUND, "there is no job %lld", (long long)id)
                                         : status;
}

enum status store_job_unplaced(struct store *store, const char *executors, const char *prefix, int64_t *id,
                               char **executor, struct error *err) {
    sqlite3_stmt *stmt;
    bool found = false;
    *executor = NULL;
    store_lock(store);
    enum status status =
        sql_first(&store->sql, &stmt, &found, err,
                  "SELECT id, executor FROM jobs WHERE state = 0 AND executor <> ''"
                  " AND (kind = 0 OR " OPEN_PARTS("jobs.id") ")"
                                                             " AND instr(?1, ' ' || executor || ' ') = 0"
                                                             " AND substr(reason, 1, length(?2)) <> ?2 LIMIT 1",
                  "tt", executors, prefix);
    if (found) {
        *id = sqlite3_column_int64(stmt, 0);
        *executor = sql_dup(stmt, 1);
        sqlite3_reset(stmt);
    }
    store_unlock(store);
    return status == STATUS_OK && !found ? error_set(err, STATUS_NOT_FOUND, "every queued job has its executor")
                                         : status;
}

enum status store_queue_check(struct store *store, int64_t owner_id, const struct count_limits *limits,
                              struct error *err) {
    int64_t queued;
    enum status status =
        sql_int(&store->sql, 0, &queued, err, "SELECT count(*) FROM jobs WHERE state = ?", "n", (int)JOB_QUEUED);
    if (status == STATUS_OK && (uint64_t)queued >= limits->all) {
        error_set(err, STATUS_LIMIT, "%lld jobs are queued already, the limit is %zu", (long long)queued, limits->all);
        return error_hint(err, "try again later; an administrator can raise the option queue_limit");
    }
    if (status != STATUS_OK || limits->one_user == 0 || owner_id == 0)
        return status;
    status = sql_int(&store->sql, 0, &queued, err, "SELECT count(*) FROM jobs WHERE owner_id = ? AND state = ?", "in",
                     owner_id, (int)JOB_QUEUED);
    if (status != STATUS_OK || (uint64_t)queued < limits->one_user)
        return status;
    error_set(err, STATUS_LIMIT, "%lld of your jobs are queued already, the limit is %zu", (long long)queued,
              limits->one_user);
    return error_hint(err, "try again later; an administrator can raise the option user_queue_limit");
}
