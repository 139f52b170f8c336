/* transitions.c -- every change of a job's state, one function each; the diagram is in job.h.
 *
 *      who asks     function            from             to
 *      user         store_job_cancel    queued, paused   cancelled
 *                                       running          running, wanted = cancel
 *                   store_job_pause     queued           paused
 *                                       running          running, wanted = pause
 *                   store_job_resume    paused           queued
 *                                       running          running, wanted = run (from pause only)
 *                   store_job_retry     failed, cancelled  queued, attempts_left = max_attempts
 *                                       (with a stage, also succeeded)
 *                   store_job_extend    any terminal     queued, attempts_left = max_attempts
 *      scheduler    store_job_start     queued           running, attempt + 1
 *                   store_job_succeed   running          succeeded
 *                   store_job_fail      running          failed
 *                   store_job_crash     running          queued, or failed on the last attempt
 *                   store_job_stop      running          queued
 *                   store_job_block     running          paused
 *      at start     store_reconcile     running          queued
 *
 * 1. Leaving `running`, a recorded request decides first: cancel turns every end into cancelled,
 *    pause turns queued into paused. (A cancelled job that had just succeeded is cancelled: its
 *    user was told so.)
 * 2. `wanted` is "run" in every state but running.
 * 3. Attempts only grow, over retries too: a number names one process for ever. */
#include <assert.h>

#include "common/json.h"
#include "common/mem.h"
#include "common/protocol.h"
#include "server/store/internal.h"
#include "server/store/store.h"

struct present {
    int64_t id;
    enum job_state state;
    enum job_wanted wanted;
    int attempt, attempts_left;
};

/* Inside a transaction: reads the job. */
static enum status look(struct store *store, int64_t id, struct present *now, struct error *err) {
    sqlite3_stmt *stmt;
    bool found = false;
    enum status status = sql_first(&store->sql, &stmt, &found, err,
                                   "SELECT state, wanted, attempt, attempts_left FROM jobs WHERE id = ?", "i", id);
    if (found) {
        *now = (struct present){
            .id = id,
            .state = (enum job_state)sqlite3_column_int(stmt, 0),
            .wanted = (enum job_wanted)sqlite3_column_int(stmt, 1),
            .attempt = sqlite3_column_int(stmt, 2),
            .attempts_left = sqlite3_column_int(stmt, 3),
        };
        sqlite3_reset(stmt);
    } else if (status == STATUS_OK) {
        status = error_set(err, STATUS_NOT_FOUND, "there is no job %lld", (long long)id);
    }
    return status;
}

static enum status begun(struct store *store, enum status status, int64_t id, struct present *now, struct error *err) {
    if (status != STATUS_OK)
        return status;
    status = look(store, id, now, err);
    return status == STATUS_OK ? status : store_end(store, status, STORE_NOTHING_CHANGED, err);
}

/* Locks, begins and reads the job. On an error everything is undone already. */
static enum status job_begin(struct store *store, int64_t id, struct present *now, struct error *err) {
    return begun(store, store_begin(store, err), id, now, err);
}

/* The same for what stops work, and works on a full disk. */
static enum status job_begin_stopping(struct store *store, int64_t id, struct present *now, struct error *err) {
    return begun(store, store_begin_freeing(store, err), id, now, err);
}

/* As job_begin, and the job must be running its attempt `attempt`. */
static enum status attempt_begin(struct store *store, int64_t id, int attempt, struct present *now, struct error *err) {
    enum status status = job_begin_stopping(store, id, now, err);
    if (status != STATUS_OK || (now->state == JOB_RUNNING && now->attempt == attempt))
        return status;
    error_set(err, STATUS_CONFLICT, "job %lld is %s (attempt %d): attempt %d is no longer the current one",
              (long long)id, job_state_name(now->state), now->attempt, attempt);
    return store_end(store, STATUS_CONFLICT, STORE_NOTHING_CHANGED, err);
}

static enum status forbidden(const struct present *now, const char *action, struct error *err) {
    const char *verb = now->state == JOB_SUCCEEDED || now->state == JOB_FAILED ? "has"
                       : now->state == JOB_CANCELLED                           ? "was"
                                                                               : "is";
    return error_set(err, STATUS_CONFLICT, "job %lld %s %s; it cannot be %s", (long long)now->id, verb,
                     job_state_name(now->state), action);
}

static enum status append_state(struct store *store, const struct present *now, const char *reason, const char *hint,
                                struct error *err) {
    cJSON *data = cJSON_CreateObject();
    json_add_string(data, "state", job_state_name(now->state)); /* the event's row has the attempt */
    if (now->wanted != JOB_WANT_RUN)
        json_add_string(data, "wanted", job_wanted_name(now->wanted));
    if (reason[0])
        json_add_string(data, "reason", reason);
    if (hint[0])
        json_add_string(data, "hint", hint);
    char *text = json_text(data);
    enum status status = store_event_append(store, now->id, now->attempt, EVENT_STATE, text, err);
    mem_free(text);
    cJSON_Delete(data);
    return status;
}

/* The only place that writes a state. *now becomes the new present. */
static enum status move(struct store *store, struct present *now, enum job_state to, const char *reason,
                        const char *hint, struct error *err) {
    if (now->state == JOB_RUNNING && now->wanted == JOB_WANT_CANCEL)
        to = JOB_CANCELLED, reason = hint = "";
    else if (now->state == JOB_RUNNING && now->wanted == JOB_WANT_PAUSE && to == JOB_QUEUED)
        to = JOB_PAUSED;
    assert(job_may_become(now->state, to));
    now->state = to;
    now->wanted = JOB_WANT_RUN;
    int64_t at = store_now_ms();
    enum status status =
        sql_run(&store->sql, err,
                "UPDATE jobs SET revision = revision + 1, events_gone = 0, state = ?, wanted = 0, attempt = ?,"
                " attempts_left = ?, reason = ?, hint = ?, finished_ms = ?, eta_sec = -1"
                " WHERE id = ?",
                "nnnttii", (int)to, now->attempt, now->attempts_left, reason, hint,
                job_is_terminal(to) ? at : (int64_t)0, now->id);
    if (status == STATUS_OK)
        status = append_state(store, now, reason, hint, err);
    return status == STATUS_OK ? store_webhook_post(store, now->id, now->attempt, job_state_name(to), reason, hint, err)
                               : status;
}

static enum status record_request(struct store *store, struct present *now, enum job_wanted wanted, struct error *err) {
    now->wanted = wanted;
    enum status status = sql_run(&store->sql, err, "UPDATE jobs SET revision = revision + 1, wanted = ? WHERE id = ?",
                                 "ni", (int)wanted, now->id);
    return status == STATUS_OK ? append_state(store, now, "", "", err) : status;
}

/* --- what users ask ---------------------------------------------------------------------- */

static enum status cancel_job(struct store *store, int64_t id, struct error *err) {
    struct present now;
    enum status status = job_begin_stopping(store, id, &now, err);
    if (status != STATUS_OK)
        return status;
    if (now.state == JOB_CANCELLED || now.wanted == JOB_WANT_CANCEL)
        return store_end(store, STATUS_OK, STORE_NOTHING_CHANGED, err);
    if (now.state == JOB_RUNNING)
        status = record_request(store, &now, JOB_WANT_CANCEL, err);
    else if (job_is_terminal(now.state))
        status = forbidden(&now, "cancelled", err);
    else
        status = move(store, &now, JOB_CANCELLED, "", "", err);
    return store_end(store, status, id, err);
}

static enum status pause_job(struct store *store, int64_t id, struct error *err) {
    struct present now;
    enum status status = job_begin_stopping(store, id, &now, err);
    if (status != STATUS_OK)
        return status;
    if (now.state == JOB_PAUSED || now.wanted == JOB_WANT_PAUSE)
        return store_end(store, STATUS_OK, STORE_NOTHING_CHANGED, err);
    if (now.wanted == JOB_WANT_CANCEL)
        status = error_set(err, STATUS_CONFLICT, "job %lld is being cancelled", (long long)id);
    else if (now.state == JOB_RUNNING)
        status = record_request(store, &now, JOB_WANT_PAUSE, err);
    else if (now.state == JOB_QUEUED)
        status = move(store, &now, JOB_PAUSED, "", "", err);
    else
        status = forbidden(&now, "paused", err);
    return store_end(store, status, id, err);
}

enum status store_job_cancel(struct store *store, int64_t id, struct error *err) {
    enum status status;
    do
        status = cancel_job(store, id, err);
    while (status == STATUS_NO_SPACE && store_reserve_spend(store));
    return status;
}

enum status store_job_pause(struct store *store, int64_t id, struct error *err) {
    enum status status;
    do
        status = pause_job(store, id, err);
    while (status == STATUS_NO_SPACE && store_reserve_spend(store));
    return status;
}

/* Into the queue by its user's request, where there is room for one more. */
static enum status enqueue(struct store *store, struct present *now, const struct count_limits *limits,
                           struct error *err) {
    int64_t owner = 0;
    enum status status = sql_int(&store->sql, 0, &owner, err, "SELECT owner_id FROM jobs WHERE id = ?", "i", now->id);
    if (status == STATUS_OK && limits)
        status = store_queue_check(store, owner, limits, err);
    return status == STATUS_OK ? move(store, now, JOB_QUEUED, "", "", err) : status;
}

enum status store_job_resume(struct store *store, int64_t id, const struct count_limits *limits, struct error *err) {
    struct present now;
    enum status status = job_begin(store, id, &now, err);
    if (status != STATUS_OK)
        return status;
    if (now.wanted == JOB_WANT_CANCEL)
        status = error_set(err, STATUS_CONFLICT, "job %lld is being cancelled", (long long)id);
    else if (now.wanted == JOB_WANT_PAUSE)
        status = record_request(store, &now, JOB_WANT_RUN, err);
    else if (now.state == JOB_PAUSED)
        status = enqueue(store, &now, limits, err);
    else if (job_is_terminal(now.state))
        status = forbidden(&now, "resumed", err);
    else /* queued or running: so it is already */
        return store_end(store, STATUS_OK, STORE_NOTHING_CHANGED, err);
    return store_end(store, status, id, err);
}

/* A new life for a job that has ended; in the transaction that job_begin began. */
static enum status revive(struct store *store, struct present *now, int max_attempts, const struct count_limits *limits,
                          struct error *err) {
    int64_t scene = 0;
    enum status status =
        sql_int(&store->sql, 0, &scene, err, "SELECT 1 FROM jobs JOIN scenes ON scenes.id = scene_id WHERE jobs.id = ?",
                "i", now->id);
    if (status == STATUS_OK && !scene)
        status = error_set(err, STATUS_CONFLICT, "the scene of job %lld was deleted", (long long)now->id);
    if (status != STATUS_OK)
        return status;
    now->attempts_left = max_attempts;
    status = enqueue(store, now, limits, err);
    /* Where it ended is not where it will be. */
    return status == STATUS_OK
               ? sql_run(&store->sql, err, "UPDATE jobs SET stage = '', progress = 0 WHERE id = ?", "i", now->id)
               : status;
}

enum status store_job_retry(struct store *store, int64_t id, int max_attempts, const char *from,
                            const struct count_limits *limits, struct error *err) {
    struct present now;
    enum status status = job_begin(store, id, &now, err);
    if (status != STATUS_OK)
        return status;
    if (!job_is_terminal(now.state) || (now.state == JOB_SUCCEEDED && !from))
        status = forbidden(&now, "retried", err);
    if (status == STATUS_CONFLICT && now.state == JOB_SUCCEEDED)
        error_hint(err, "name the stage to do anew (retry --from STAGE), or extend it");
    if (status == STATUS_OK)
        status = revive(store, &now, max_attempts, limits, err);
    if (status == STATUS_OK)
        status = sql_run(&store->sql, err, "UPDATE jobs SET restart_from = ?, memory_step = 0 WHERE id = ?", "ti",
                         from ? from : "", id);
    return store_end(store, status, id, err);
}

enum status store_job_extend(struct store *store, int64_t id, int max_attempts, const char *settings,
                             const struct count_limits *limits, struct error *err) {
    struct present now;
    enum status status = job_begin(store, id, &now, err);
    if (status != STATUS_OK)
        return status;
    if (!job_is_terminal(now.state))
        status = forbidden(&now, "extended", err);
    if (status == STATUS_OK)
        status = revive(store, &now, max_attempts, limits, err);
    if (status == STATUS_OK)
        status = sql_run(&store->sql, err, "UPDATE jobs SET settings = ? WHERE id = ?", "ti", settings, id);
    return store_end(store, status, id, err);
}

/* --- what the scheduler does --------------------------------------------------------------- */

enum status store_job_start(struct store *store, int64_t id, int *attempt, struct error *err) {
    struct present now;
    enum status status = job_begin(store, id, &now, err);
    if (status != STATUS_OK)
        return status;
    int64_t is_unchecked = 0;
    if (now.state != JOB_QUEUED)
        status = forbidden(&now, "started", err);
    if (status == STATUS_OK)
        status =
            sql_int(&store->sql, 0, &is_unchecked, err,
                    "SELECT 1 FROM jobs JOIN scenes ON scenes.id = scene_id WHERE jobs.id = ? AND scenes.state < ?",
                    "in", id, (int)SCENE_READY);
    if (is_unchecked)
        status = error_set(err, STATUS_CONFLICT, "the scene of job %lld is being checked", (long long)id);
    if (status == STATUS_OK) {
        now.attempt++;
        status = move(store, &now, JOB_RUNNING, "", "", err);
    }
    if (status == STATUS_OK)
        status = sql_run(&store->sql, err, "UPDATE jobs SET started_ms = ? WHERE id = ?", "ii", store_now_ms(), id);
    *attempt = now.attempt;
    return store_end(store, status, id, err);
}

static enum status finish_once(struct store *store, int64_t id, int attempt, enum job_state to, const char *reason,
                               const char *hint, struct error *err) {
    struct present now;
    enum status status = attempt_begin(store, id, attempt, &now, err);
    if (status != STATUS_OK)
        return status;
    status = move(store, &now, to, reason, hint, err);
    return store_end(store, status, id, err);
}

/* The end of an attempt in state `to`. */
static enum status finish(struct store *store, int64_t id, int attempt, enum job_state to, const char *reason,
                          const char *hint, struct error *err) {
    enum status status;
    do
        status = finish_once(store, id, attempt, to, reason, hint, err);
    while (status == STATUS_NO_SPACE && store_reserve_spend(store));
    return status;
}

enum status store_job_succeed(struct store *store, int64_t id, int attempt, struct error *err) {
    return store_job_succeed_but(store, id, attempt, "", err);
}

enum status store_job_succeed_but(struct store *store, int64_t id, int attempt, const char *reason, struct error *err) {
    return finish(store, id, attempt, JOB_SUCCEEDED, reason, "", err);
}

enum status store_job_fail(struct store *store, int64_t id, int attempt, const char *reason, const char *hint,
                           struct error *err) {
    return finish(store, id, attempt, JOB_FAILED, reason, hint, err);
}

enum status store_job_restarted(struct store *store, int64_t id, int attempt, struct error *err) {
    struct present now;
    enum status status = attempt_begin(store, id, attempt, &now, err);
    if (status != STATUS_OK)
        return status;
    status = sql_run(&store->sql, err, "UPDATE jobs SET restart_from = '' WHERE id = ?", "i", id);
    return store_end(store, status, STORE_NOTHING_CHANGED, err);
}

static enum status crash(struct store *store, int64_t id, int attempt, const char *reason, const char *hint,
                         int memory_step, struct error *err) {
    struct present now;
    enum status status = attempt_begin(store, id, attempt, &now, err);
    if (status != STATUS_OK)
        return status;
    now.attempts_left -= now.attempts_left > 0;
    status = move(store, &now, now.attempts_left > 0 ? JOB_QUEUED : JOB_FAILED, reason, hint, err);
    if (status == STATUS_OK)
        status = sql_run(&store->sql, err, "UPDATE jobs SET memory_step = ? WHERE id = ?", "ni", memory_step, id);
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

enum status store_job_stop(struct store *store, int64_t id, int attempt, const char *reason, struct error *err) {
    return finish(store, id, attempt, JOB_QUEUED, reason, "", err);
}

enum status store_job_block(struct store *store, int64_t id, int attempt, const char *reason, const char *hint,
                            struct error *err) {
    return finish(store, id, attempt, JOB_PAUSED, reason, hint, err);
}

/* Inside a transaction: gives one such job its reason. *id: which; 0: there was none. */
static enum status explain_one(struct store *store, const char *reason, const char *prefix, const char *hint,
                               int64_t *id, struct error *err) {
    struct present now;
    enum status status = sql_int(&store->sql, 0, id, err,
                                 "SELECT id FROM jobs WHERE state = ?1 AND reason <> ?2"
                                 " AND (?2 <> '' OR substr(reason, 1, length(?3)) = ?3) LIMIT 1",
                                 "ntt", (int)JOB_QUEUED, reason, prefix);
    if (status != STATUS_OK || *id == 0)
        return status;
    status = look(store, *id, &now, err);
    if (status == STATUS_OK)
        status = sql_run(&store->sql, err, "UPDATE jobs SET revision = revision + 1, reason = ?, hint = ? WHERE id = ?",
                         "tti", reason, hint, *id);
    return status == STATUS_OK ? append_state(store, &now, reason, hint, err) : status;
}

enum status store_job_explain(struct store *store, const char *reason, const char *prefix, const char *hint,
                              struct error *err) {
    for (;;) { /* a transaction each: others get their turns in between */
        int64_t id;
        enum status status = store_begin(store, err);
        if (status != STATUS_OK)
            return status;
        status = explain_one(store, reason, prefix, hint, &id, err);
        status = store_end(store, status, id ? id : STORE_NOTHING_CHANGED, err);
        if (status != STATUS_OK || id == 0)
            return status;
    }
}

static enum status requeue_one(struct store *store, int64_t *id, struct error *err) {
    struct present now;
    enum status status =
        sql_int(&store->sql, 0, id, err, "SELECT id FROM jobs WHERE state = ? LIMIT 1", "n", (int)JOB_RUNNING);
    if (status != STATUS_OK || *id == 0)
        return status;
    status = look(store, *id, &now, err);
    if (status == STATUS_OK)
        status = sql_run(&store->sql, err, "UPDATE jobs SET disk_bytes = -1 WHERE id = ?", "i", *id);
    return status == STATUS_OK ? move(store, &now, JOB_QUEUED, "the daemon was restarted", "", err) : status;
}

enum status store_reconcile(struct store *store, size_t *requeued, struct error *err) {
    *requeued = 0;
    for (;;) {
        int64_t id = 0;
        enum status status = store_begin_freeing(store, err);
        if (status != STATUS_OK)
            return status;
        status = requeue_one(store, &id, err);
        status = store_end(store, status, id ? id : STORE_NOTHING_CHANGED, err);
        if (status == STATUS_NO_SPACE && store_reserve_spend(store))
            continue;
        if (status != STATUS_OK || id == 0)
            return status;
        ++*requeued;
    }
}
