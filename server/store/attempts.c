/* attempts.c -- see attempts.h. Every change of a job's state that its attempts bring about:
 *
 *      function            from             to                                        the attempt's ending
 *      store_job_start     queued           running, attempt + 1
 *      store_job_succeed   running          succeeded                                 succeeded
 *      store_job_fail      running          failed                                    failed
 *      store_job_crash     running          queued, or failed on the last attempt     crashed
 *      store_job_lose      running          queued, or failed after too many          lost
 *      store_job_stop      running          queued                                    stopped
 *      store_job_block     running          paused                                    blocked
 *      store_job_split     running          running                                   split
 *      store_job_yield     running          queued                                    (none runs)
 *      store_reconcile     running          queued                                    restarted
 *
 * Of a job that is split this is what the end of one part's attempt would make of the job, and makes of the part: where
 * the others take it, parts.h says.
 *
 * Leaving `running`, a recorded request decides first: cancel turns every end into cancelled, pause turns queued into
 * paused. (A cancelled job that had just succeeded is cancelled: its user was told so.) The attempt's ending is that
 * which it had. */
#include "server/store/attempts.h"

#include <stdio.h>
#include <string.h>

#include "server/store/transition.h"

/* --- the table ------------------------------------------------------------------------------- */

static void fill(struct attempt_row *row, sqlite3_stmt *stmt) {
    *row = (struct attempt_row){.number = sqlite3_column_int(stmt, 0),
                                .phase = (enum attempt_row_phase)sqlite3_column_int(stmt, 2)};
    snprintf(row->executor, sizeof row->executor, "%s", sql_text(stmt, 1));
    snprintf(row->ending, sizeof row->ending, "%s", sql_text(stmt, 3));
}

enum status store_attempt_list(struct store *store, int64_t job_id, size_t limit, struct attempt_row *rows,
                               size_t *count, struct error *err) {
    sqlite3_stmt *stmt;
    *count = 0;
    store_lock(store);
    enum status status = sql_query(&store->sql, &stmt, err,
                                   "SELECT number, executor, phase, ending FROM attempts WHERE job_id = ?"
                                   " ORDER BY number DESC LIMIT ?",
                                   "ii", job_id, (int64_t)limit);
    while (sql_next(&store->sql, stmt, &status, err))
        fill(&rows[(*count)++], stmt);
    store_unlock(store);
    if (status != STATUS_OK)
        *count = 0;
    return status;
}

enum status store_attempt_get(struct store *store, const struct attempt_key *key, struct attempt_row *row,
                              struct error *err) {
    sqlite3_stmt *stmt;
    bool found = false;
    *row = (struct attempt_row){0};
    store_lock(store);
    enum status status =
        sql_first(&store->sql, &stmt, &found, err,
                  "SELECT number, executor, phase, ending FROM attempts WHERE job_id = ? AND number = ?", "in",
                  key->job_id, key->number);
    if (found) {
        fill(row, stmt);
        sqlite3_reset(stmt);
    }
    store_unlock(store);
    return status == STATUS_OK && !found
               ? error_set(err, STATUS_NOT_FOUND, "job %lld has no attempt %d", (long long)key->job_id, key->number)
               : status;
}

enum status store_attempt_former(struct store *store, int64_t *job_id, int *number, struct error *err) {
    sqlite3_stmt *stmt;
    bool found = false;
    store_lock(store);
    enum status status =
        sql_first(&store->sql, &stmt, &found, err, "SELECT job_id, number FROM attempts WHERE phase = 0 LIMIT 1", "");
    if (found) {
        *job_id = sqlite3_column_int64(stmt, 0);
        *number = sqlite3_column_int(stmt, 1);
        sqlite3_reset(stmt);
    }
    store_unlock(store);
    return status == STATUS_OK && !found ? error_set(err, STATUS_NOT_FOUND, "every attempt has its own folder")
                                         : status;
}

enum status store_attempt_adopted(struct store *store, int64_t job_id, int number, struct error *err) {
    enum status status = store_begin(store, err);
    if (status != STATUS_OK)
        return status;
    status = sql_run(&store->sql, err,
                     "UPDATE attempts SET phase = iif((SELECT state FROM jobs WHERE id = job_id) = ?, ?, ?)"
                     " WHERE job_id = ? AND part = 0 AND number = ? AND phase = ?",
                     "nnninn", (int)JOB_RUNNING, (int)ATTEMPT_ROW_RUNNING, (int)ATTEMPT_ROW_ENDED, job_id, number,
                     (int)ATTEMPT_ROW_FORMER);
    return store_end(store, status, STORE_NOTHING_CHANGED, err);
}

/* --- the transitions ------------------------------------------------------------------------- */

/* Inside a transaction: the part of which the job runs that attempt; -1: it does not. */
static enum status running_part(struct store *store, int64_t id, int attempt, int64_t *part, struct error *err) {
    return sql_int(&store->sql, -1, part, err,
                   "SELECT part FROM attempts WHERE job_id = ? AND number = ? AND phase = ?", "inn", id, attempt,
                   (int)ATTEMPT_ROW_RUNNING);
}

enum status attempt_begin_end(struct store *store, int64_t id, int attempt, const char *ending, struct present *now,
                              struct error *err) {
    int64_t part = -1;
    enum status status = transition_begin_stopping(store, id, now, err);
    if (status != STATUS_OK)
        return status;
    if (now->state == JOB_RUNNING)
        status = running_part(store, id, attempt, &part, err);
    if (status == STATUS_OK && part < 0)
        status = error_set(err, STATUS_CONFLICT, "job %lld is %s (attempt %d): attempt %d is no longer the current one",
                           (long long)id, job_state_name(now->state), now->attempt, attempt);
    now->ending = ending;
    now->attempt = attempt;
    now->part = (int)part;
    return status == STATUS_OK ? status : store_end(store, status, STORE_NOTHING_CHANGED, err);
}

enum status attempt_end_one(struct store *store, const struct present *now, struct error *err) {
    enum status status =
        sql_run(&store->sql, err, "UPDATE remote SET phase = 3 WHERE job_id = ? AND number = ? AND phase < 3", "in",
                now->id, now->attempt);
    if (status == STATUS_OK)
        status = sql_run(&store->sql, err, "DELETE FROM attempt_lines WHERE job_id = ? AND number = ?", "in", now->id,
                         now->attempt);
    if (status == STATUS_OK)
        status = sql_run(&store->sql, err,
                         "UPDATE attempts SET phase = ?, ending = ? WHERE job_id = ? AND number = ? AND phase = ?",
                         "ntinn", (int)ATTEMPT_ROW_ENDED, now->ending, now->id, now->attempt, (int)ATTEMPT_ROW_RUNNING);
    return status == STATUS_OK
               ? sql_run(&store->sql, err, "UPDATE jobs SET revision = revision + 1 WHERE id = ?", "i", now->id)
               : status;
}

enum status attempt_leave(struct store *store, struct present *now, enum job_state to, const char *reason,
                          const char *hint, struct error *err) {
    struct part_verdict v = {.to = JOB_QUEUED};
    int64_t others = 0;
    bool is_split = strcmp(now->ending, ENDING_SPLIT) == 0;
    if (now->part == 0 && !is_split)
        return transition_move(store, now, to, reason, hint, err);
    enum status status = is_split ? STATUS_OK : part_end(store, now, to, reason, hint, err);
    if (status == STATUS_OK)
        status = part_append_event(store, now, to, reason, err);
    if (status == STATUS_OK)
        status = sql_int(&store->sql, 0, &others, err,
                         "SELECT count(*) FROM attempts WHERE job_id = ? AND number <> ? AND phase = ?", "inn", now->id,
                         now->attempt, (int)ATTEMPT_ROW_RUNNING);
    if (status == STATUS_OK)
        status = part_verdict(store, now->id, &v, err);
    if (status != STATUS_OK)
        return status;
    bool goes_on = others > 0 || (v.to == JOB_QUEUED && now->wanted == JOB_WANT_RUN);
    return goes_on ? attempt_end_one(store, now, err) : transition_move(store, now, v.to, v.reason, v.hint, err);
}

/* Whether a job that runs, and is wanted, goes on with that part (-1: none). */
static bool is_further(const struct present *now, int64_t part) {
    return now->state == JOB_RUNNING && now->wanted == JOB_WANT_RUN && part >= 0;
}

enum status store_job_start(struct store *store, int64_t id, const char *executor, int *attempt, struct error *err) {
    struct present now;
    enum status status = transition_begin(store, id, &now, err);
    if (status != STATUS_OK)
        return status;
    int64_t is_unchecked = 0, part = -1;
    bool is_queued = now.state == JOB_QUEUED;
    status = sql_int(&store->sql, -1, &part, err, "SELECT ifnull(" NEXT_PART("jobs.id") ", -1) FROM jobs WHERE id = ?",
                     "i", id);
    if (status == STATUS_OK && !(is_queued && part >= 0) && !is_further(&now, part))
        status = transition_forbidden(&now, "started", err);
    if (status == STATUS_OK)
        status = sql_int(&store->sql, 0, &is_unchecked, err,
                         "SELECT 1 FROM jobs JOIN scenes ON scenes.id = scene_id WHERE jobs.id = ? AND scenes.state < ?"
                         " AND kind <> 1",
                         "in", id, (int)SCENE_READY);
    if (is_unchecked)
        status = error_set(err, STATUS_CONFLICT, "the scene of job %lld is being checked", (long long)id);
    now.attempt++;
    if (status == STATUS_OK && is_queued)
        status = transition_move(store, &now, JOB_RUNNING, "", "", err);
    else if (status == STATUS_OK)
        status = sql_run(&store->sql, err, "UPDATE jobs SET revision = revision + 1, attempt = ? WHERE id = ?", "ni",
                         now.attempt, id);
    if (status == STATUS_OK)
        status = sql_run(&store->sql, err,
                         "INSERT INTO attempts (job_id, part, number, executor, phase) VALUES (?, ?, ?, ?, ?)", "iintn",
                         id, part, now.attempt, executor, (int)ATTEMPT_ROW_RUNNING);
    if (status == STATUS_OK && is_queued)
        status = sql_run(&store->sql, err, "UPDATE jobs SET started_ms = ? WHERE id = ?", "ii", store_now_ms(), id);
    *attempt = now.attempt;
    return store_end(store, status, id, err);
}

static enum status finish_once(struct store *store, int64_t id, int attempt, enum job_state to, const char *ending,
                               const char *reason, const char *hint, struct error *err) {
    struct present now;
    enum status status = attempt_begin_end(store, id, attempt, ending, &now, err);
    if (status != STATUS_OK)
        return status;
    status = attempt_leave(store, &now, to, reason, hint, err);
    return store_end(store, status, id, err);
}

/* The end of an attempt in state `to`. */
static enum status finish(struct store *store, int64_t id, int attempt, enum job_state to, const char *ending,
                          const char *reason, const char *hint, struct error *err) {
    enum status status;
    do
        status = finish_once(store, id, attempt, to, ending, reason, hint, err);
    while (status == STATUS_NO_SPACE && store_reserve_spend(store));
    return status;
}

enum status store_job_succeed(struct store *store, int64_t id, int attempt, const char *reason, struct error *err) {
    return finish(store, id, attempt, JOB_SUCCEEDED, ENDING_SUCCEEDED, reason, "", err);
}

enum status store_job_fail(struct store *store, int64_t id, int attempt, const char *reason, const char *hint,
                           struct error *err) {
    return finish(store, id, attempt, JOB_FAILED, ENDING_FAILED, reason, hint, err);
}

enum status store_job_restarted(struct store *store, int64_t id, int attempt, struct error *err) {
    struct present now;
    enum status status = attempt_begin_end(store, id, attempt, NULL, &now, err);
    if (status != STATUS_OK)
        return status;
    status = sql_run(&store->sql, err, "UPDATE jobs SET restart_from = '' WHERE id = ?", "i", id);
    return store_end(store, status, STORE_NOTHING_CHANGED, err);
}

/* Inside a transaction: one attempt fewer. *left: for the job or, where it is split, for the part. */
static enum status count_crash(struct store *store, struct present *now, int64_t *left, struct error *err) {
    if (now->part == 0) {
        now->attempts_left -= now->attempts_left > 0;
        *left = now->attempts_left;
        return STATUS_OK;
    }
    enum status status =
        sql_run(&store->sql, err, "UPDATE parts SET crashes = crashes + 1 WHERE job_id = ? AND part = ?", "in", now->id,
                now->part);
    return status == STATUS_OK
               ? sql_int(&store->sql, 0, left, err, "SELECT ? - crashes FROM parts WHERE job_id = ? AND part = ?",
                         "nin", now->attempts_left, now->id, now->part)
               : status;
}

static enum status crash(struct store *store, int64_t id, int attempt, const char *reason, const char *hint,
                         int memory_step, struct error *err) {
    struct present now;
    int64_t left = 0;
    enum status status = attempt_begin_end(store, id, attempt, ENDING_CRASHED, &now, err);
    if (status != STATUS_OK)
        return status;
    status = count_crash(store, &now, &left, err);
    if (status == STATUS_OK)
        status = attempt_leave(store, &now, left > 0 ? JOB_QUEUED : JOB_FAILED, reason, hint, err);
    if (status == STATUS_OK)
        status = sql_run(&store->sql, err, "UPDATE jobs SET memory_step = max(memory_step, ?) WHERE id = ?", "ni",
                         memory_step, id);
    return store_end(store, status, id, err);
}

enum status store_job_crash(struct store *store, int64_t id, int attempt, const char *reason, const char *hint,
                            int memory_step, struct error *err) {
    enum status status;
    do
        status = crash(store, id, attempt, reason, hint, memory_step, err);
    while (status == STATUS_NO_SPACE && store_reserve_spend(store));
    return status;
}

/* Inside a transaction: how many of the part's attempts were lost in a row until now. */
static enum status count_lost(struct store *store, int64_t id, int part, int64_t *count, struct error *err) {
    return sql_int(&store->sql, 0, count, err,
                   "SELECT count(*) FROM attempts WHERE job_id = ?1 AND part = ?4 AND ending = ?2 AND number >"
                   " (SELECT ifnull(max(number), 0) FROM attempts WHERE job_id = ?1 AND part = ?4"
                   "  AND phase = ?3 AND ending <> ?2)",
                   "itnn", id, ENDING_LOST, (int)ATTEMPT_ROW_ENDED, part);
}

static enum status lose(struct store *store, int64_t id, int attempt, const char *reason, struct error *err) {
    struct present now;
    int64_t lost = 0;
    enum status status = attempt_begin_end(store, id, attempt, ENDING_LOST, &now, err);
    if (status != STATUS_OK)
        return status;
    status = count_lost(store, id, now.part, &lost, err);
    if (status == STATUS_OK)
        status = attempt_leave(store, &now, lost + 1 < ATTEMPTS_LOST_MAX ? JOB_QUEUED : JOB_FAILED, reason, "", err);
    return store_end(store, status, id, err);
}

enum status store_job_lose(struct store *store, int64_t id, int attempt, const char *reason, struct error *err) {
    enum status status;
    do
        status = lose(store, id, attempt, reason, err);
    while (status == STATUS_NO_SPACE && store_reserve_spend(store));
    return status;
}

enum status store_job_stop(struct store *store, int64_t id, int attempt, const char *reason, struct error *err) {
    return finish(store, id, attempt, JOB_QUEUED, ENDING_STOPPED, reason, "", err);
}

enum status store_job_block(struct store *store, int64_t id, int attempt, const char *reason, const char *hint,
                            struct error *err) {
    return finish(store, id, attempt, JOB_PAUSED, ENDING_BLOCKED, reason, hint, err);
}

/* Inside a transaction: gives one such job its reason. *id: which; 0: there was none. */
static enum status explain_one(struct store *store, int64_t only, const char *reason, const char *prefix,
                               const char *hint, int64_t *id, struct error *err) {
    struct present now;
    enum status status = sql_int(&store->sql, 0, id, err,
                                 "SELECT id FROM jobs WHERE state = ?1 AND reason <> ?2"
                                 " AND (?2 <> '' OR substr(reason, 1, length(?3)) = ?3) AND ?4 IN (0, id) LIMIT 1",
                                 "ntti", (int)JOB_QUEUED, reason, prefix, only);
    if (status != STATUS_OK || *id == 0)
        return status;
    status = transition_read(store, *id, &now, err);
    if (status == STATUS_OK)
        status = sql_run(&store->sql, err, "UPDATE jobs SET revision = revision + 1, reason = ?, hint = ? WHERE id = ?",
                         "tti", reason, hint, *id);
    return status == STATUS_OK ? transition_append_event(store, &now, reason, hint, err) : status;
}

enum status store_job_explain(struct store *store, int64_t only, const char *reason, const char *prefix,
                              const char *hint, struct error *err) {
    for (;;) { /* a transaction each: others get their turns in between */
        int64_t id;
        enum status status = store_begin(store, err);
        if (status != STATUS_OK)
            return status;
        status = explain_one(store, only, reason, prefix, hint, &id, err);
        status = store_end(store, status, id ? id : STORE_NOTHING_CHANGED, err);
        if (status != STATUS_OK || id == 0)
            return status;
    }
}
