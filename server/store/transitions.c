/* transitions.c -- what users ask of jobs: one function for each change of state; the diagram is in job.h.
 *
 *      who asks     function            from             to
 *      user         store_job_cancel    queued, paused   cancelled
 *                                       running          running, wanted = cancel
 *                   store_job_pause     queued           paused
 *                                       running          running, wanted = pause
 *                   store_job_resume    paused           queued (not while its files are to be sent)
 *                                       running          running, wanted = run (from pause only)
 *                   store_job_retry     failed, cancelled  queued, attempts_left = max_attempts
 *                                       (with a stage, also succeeded)
 *                   store_job_extend    any terminal     queued, attempts_left = max_attempts
 *
 * What the scheduler does is in attempts.c. `wanted` is "run" in every state but running. */
#include "server/store/store.h"
#include "server/store/transition.h"

static enum status record_request(struct store *store, struct present *now, enum job_wanted wanted, struct error *err) {
    now->wanted = wanted;
    enum status status = sql_run(&store->sql, err, "UPDATE jobs SET revision = revision + 1, wanted = ? WHERE id = ?",
                                 "ni", (int)wanted, now->id);
    return status == STATUS_OK ? transition_append_event(store, now, "", "", err) : status;
}

/* --- what users ask ---------------------------------------------------------------------- */

static enum status cancel_job(struct store *store, int64_t id, struct error *err) {
    struct present now;
    enum status status = transition_begin_stopping(store, id, &now, err);
    if (status != STATUS_OK)
        return status;
    if (now.state == JOB_CANCELLED || now.wanted == JOB_WANT_CANCEL)
        return store_end(store, STATUS_OK, STORE_NOTHING_CHANGED, err);
    if (now.state == JOB_RUNNING)
        status = record_request(store, &now, JOB_WANT_CANCEL, err);
    else if (job_is_terminal(now.state))
        status = transition_forbidden(&now, "cancelled", err);
    else
        status = transition_move(store, &now, JOB_CANCELLED, "", "", err);
    return store_end(store, status, id, err);
}

static enum status pause_job(struct store *store, int64_t id, struct error *err) {
    struct present now;
    enum status status = transition_begin_stopping(store, id, &now, err);
    if (status != STATUS_OK)
        return status;
    if (now.state == JOB_PAUSED || now.wanted == JOB_WANT_PAUSE)
        return store_end(store, STATUS_OK, STORE_NOTHING_CHANGED, err);
    if (now.wanted == JOB_WANT_CANCEL)
        status = error_set(err, STATUS_CONFLICT, "job %lld is being cancelled", (long long)id);
    else if (now.state == JOB_RUNNING)
        status = record_request(store, &now, JOB_WANT_PAUSE, err);
    else if (now.state == JOB_QUEUED)
        status = transition_move(store, &now, JOB_PAUSED, "", "", err);
    else
        status = transition_forbidden(&now, "paused", err);
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
    if (status == STATUS_OK)
        status = store_job_files_check(store, now->id, err);
    if (status == STATUS_OK && limits)
        status = store_queue_check(store, owner, limits, err);
    if (status == STATUS_OK) /* what had blocked a part is tried again */
        status =
            sql_run(&store->sql, err,
                    "UPDATE parts SET state = 0, reason = '', hint = '' WHERE job_id = ? AND state = 3", "i", now->id);
    return status == STATUS_OK ? transition_move(store, now, JOB_QUEUED, "", "", err) : status;
}

enum status store_job_resume(struct store *store, int64_t id, const struct count_limits *limits, struct error *err) {
    struct present now;
    enum status status = transition_begin(store, id, &now, err);
    if (status != STATUS_OK)
        return status;
    if (now.wanted == JOB_WANT_CANCEL)
        status = error_set(err, STATUS_CONFLICT, "job %lld is being cancelled", (long long)id);
    else if (now.wanted == JOB_WANT_PAUSE)
        status = record_request(store, &now, JOB_WANT_RUN, err);
    else if (now.state == JOB_PAUSED)
        status = enqueue(store, &now, limits, err);
    else if (job_is_terminal(now.state))
        status = transition_forbidden(&now, "resumed", err);
    else /* queued or running: so it is already */
        return store_end(store, STATUS_OK, STORE_NOTHING_CHANGED, err);
    return store_end(store, status, id, err);
}

/* A new life for a job that has ended; in the transaction that job_begin began. */
static enum status revive(struct store *store, struct present *now, int max_attempts, const struct count_limits *limits,
                          struct error *err) {
    int64_t scene = 0, source = 0;
    enum status status =
        sql_int(&store->sql, 0, &scene, err,
                "SELECT 1 FROM jobs WHERE id = ? AND (kind = 1 OR scene_id IN (SELECT id FROM scenes))", "i", now->id);
    if (status == STATUS_OK && !scene)
        status = error_set(err, STATUS_CONFLICT, "the scene of job %lld was deleted", (long long)now->id);
    if (status == STATUS_OK)
        status = sql_int(&store->sql, 0, &source, err, "SELECT source_id FROM jobs WHERE id = ?", "i", now->id);
    if (status == STATUS_OK && source)
        status = source_check_readable(store, source, err);
    if (status == STATUS_OK)
        status = source_check_unread(store, now->id, "done again", err);
    if (status == STATUS_NOT_FOUND)
        status = err->status = STATUS_CONFLICT; /* not the job that was asked for */
    if (status != STATUS_OK)
        return status;
    now->attempts_left = max_attempts;
    status = sql_run(&store->sql, err, "DELETE FROM parts WHERE job_id = ?", "i", now->id); /* it is split anew */
    if (status != STATUS_OK)
        return status;
    status = enqueue(store, now, limits, err);
    /* Where it ended is not where it will be. */
    return status == STATUS_OK
               ? sql_run(&store->sql, err, "UPDATE jobs SET stage = '', progress = 0 WHERE id = ?", "i", now->id)
               : status;
}

enum status store_job_retry(struct store *store, int64_t id, int max_attempts, const char *from,
                            const struct count_limits *limits, struct error *err) {
    struct present now;
    enum status status = transition_begin(store, id, &now, err);
    if (status != STATUS_OK)
        return status;
    if (!job_is_terminal(now.state) || (now.state == JOB_SUCCEEDED && !from))
        status = transition_forbidden(&now, "retried", err);
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
    enum status status = transition_begin(store, id, &now, err);
    if (status != STATUS_OK)
        return status;
    if (!job_is_terminal(now.state))
        status = transition_forbidden(&now, "extended", err);
    if (status == STATUS_OK)
        status = revive(store, &now, max_attempts, limits, err);
    if (status == STATUS_OK)
        status = sql_run(
            &store->sql, err,
            "UPDATE jobs SET settings = ?1, executor = iif(json_valid(?1), ifnull(json_extract(?1, '$.executor'), ''), '') WHERE id = ?2",
            "ti", settings, id);
    return store_end(store, status, id, err);
}
