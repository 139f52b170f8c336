/* transition.c -- see transition.h. */
#include "server/store/transition.h"

#include <assert.h>

#include "common/json.h"
#include "common/mem.h"
#include "common/protocol.h"

enum status transition_read(struct store *store, int64_t id, struct present *now, struct error *err) {
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
    status = transition_read(store, id, now, err);
    return status == STATUS_OK ? status : store_end(store, status, STORE_NOTHING_CHANGED, err);
}

enum status transition_begin(struct store *store, int64_t id, struct present *now, struct error *err) {
    return begun(store, store_begin(store, err), id, now, err);
}

enum status transition_begin_stopping(struct store *store, int64_t id, struct present *now, struct error *err) {
    return begun(store, store_begin_freeing(store, err), id, now, err);
}

enum status transition_forbidden(const struct present *now, const char *action, struct error *err) {
    const char *verb = now->state == JOB_SUCCEEDED || now->state == JOB_FAILED ? "has"
                       : now->state == JOB_CANCELLED                           ? "was"
                                                                               : "is";
    return error_set(err, STATUS_CONFLICT, "job %lld %s %s; it cannot be %s", (long long)now->id, verb,
                     job_state_name(now->state), action);
}

enum status transition_append_event(struct store *store, const struct present *now, const char *reason,
                                    const char *hint, struct error *err) {
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

/* The attempts end with their job's run, and what nodes may still say of them is not wanted. */
static enum status end_attempts(struct store *store, const struct present *now, struct error *err) {
    enum status status =
        sql_run(&store->sql, err, "UPDATE remote SET phase = 3 WHERE job_id = ? AND phase < 3", "i", now->id);
    if (status == STATUS_OK)
        status = sql_run(&store->sql, err, "DELETE FROM attempt_lines WHERE job_id = ?", "i", now->id);
    if (status != STATUS_OK)
        return status;
    return sql_run(&store->sql, err, "UPDATE attempts SET phase = ?, ending = ? WHERE job_id = ? AND phase = ?", "ntin",
                   (int)ATTEMPT_ROW_ENDED, now->ending, now->id, (int)ATTEMPT_ROW_RUNNING);
}

enum status transition_move(struct store *store, struct present *now, enum job_state to, const char *reason,
                            const char *hint, struct error *err) {
    if (now->state == JOB_RUNNING && now->wanted == JOB_WANT_CANCEL)
        to = JOB_CANCELLED, reason = hint = "";
    else if (now->state == JOB_RUNNING && now->wanted == JOB_WANT_PAUSE && to == JOB_QUEUED)
        to = JOB_PAUSED;
    assert(job_may_become(now->state, to));
    bool ends = now->state == JOB_RUNNING;
    now->state = to;
    now->wanted = JOB_WANT_RUN;
    int64_t at = store_now_ms();
    enum status status = STATUS_OK;
    if (ends)
        status = end_attempts(store, now, err);
    if (status == STATUS_OK)
        status = sql_run(
            &store->sql, err,
            "UPDATE jobs SET revision = revision + 1, events_gone = 0, state = ?, wanted = 0, attempt = max(attempt, ?),"
            " attempts_left = ?, reason = ?, hint = ?, finished_ms = ?, eta_sec = -1"
            " WHERE id = ?",
            "nnnttii", (int)to, now->attempt, now->attempts_left, reason, hint, job_is_terminal(to) ? at : (int64_t)0,
            now->id);
    if (status == STATUS_OK)
        status = transition_append_event(store, now, reason, hint, err);
    return status == STATUS_OK ? store_webhook_post(store, now->id, now->attempt, job_state_name(to), reason, hint, err)
                               : status;
}
