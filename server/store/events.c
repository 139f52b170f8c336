/* events.c -- the events of jobs; see store.h. */
#include <math.h>
#include <string.h>

#include "common/json.h"
#include "common/protocol.h"
#include "server/store/internal.h"

enum status store_event_append(struct store *store, int64_t job_id, int attempt, const char *type,
                               const char *data, struct error *err) {
    return sql_run(&store->sql, err,
                   "INSERT INTO events (job_id, at_ms, attempt, type, data)"
                   " VALUES (?, ?, ?, ?, ?)",
                   "iintt", job_id, store_now_ms(), attempt, type, data);
}

enum status store_fence(struct store *store, int64_t job_id, int attempt, struct error *err) {
    int64_t present;
    enum status status =
        sql_int(&store->sql, -1, &present, err,
                "SELECT CASE state WHEN ?2 THEN attempt ELSE 0 END FROM jobs WHERE id = ?1", "in",
                job_id, (int)JOB_RUNNING);
    if (status != STATUS_OK)
        return status;
    if (present < 0)
        return error_set(err, STATUS_NOT_FOUND, "there is no job %lld", (long long)job_id);
    if (present != attempt)
        return error_set(err, STATUS_CONFLICT, "attempt %d of job %lld is over", attempt,
                         (long long)job_id);
    return STATUS_OK;
}

/* Takes the present place of the job from a progress event into its row. */
static enum status update_progress(struct store *store, int64_t job_id, const char *data,
                                   struct error *err) {
    cJSON *object;
    const char *stage;
    double done, total, eta_sec;
    enum status status = json_parse(data, strlen(data), "a progress event", &object, err);
    if (status == STATUS_OK)
        status = json_string(object, "stage", "a progress event", "", &stage, err);
    if (status == STATUS_OK)
        status = json_number(object, "done", "a progress event", 0.0, &done, err);
    if (status == STATUS_OK)
        status = json_number(object, "total", "a progress event", 0.0, &total, err);
    if (status == STATUS_OK)
        status = json_number(object, "eta_sec", "a progress event", -1.0, &eta_sec, err);
    if (status == STATUS_OK)
        status = sql_run(&store->sql, err,
                         "UPDATE jobs SET revision = revision + 1, stage = ?, progress = ?,"
                         " eta_sec = ? WHERE id = ?",
                         "tddi", stage, total > 0.0 ? fmin(fmax(done / total, 0.0), 1.0) : 0.0,
                         eta_sec, job_id);
    cJSON_Delete(object);
    return status;
}

enum status store_event_add(struct store *store, int64_t job_id, int attempt, const char *type,
                            const char *data, struct error *err) {
    enum status status = store_begin(store, err);
    if (status != STATUS_OK)
        return status;
    status = store_fence(store, job_id, attempt, err);
    if (status == STATUS_OK && strcmp(type, EVENT_PROGRESS) == 0) {
        status = update_progress(store, job_id, data, err);
        if (status == STATUS_OK)
            status = sql_run(&store->sql, err,
                             "DELETE FROM events WHERE job_id = ? AND type = 'progress'", "i",
                             job_id);
    }
    if (status == STATUS_OK)
        status = store_event_append(store, job_id, attempt, type, data, err);
    return store_end(store, status, job_id, err);
}

enum status store_event_list(struct store *store, int64_t job_id, int64_t after, size_t limit,
                             void (*each)(void *user, int64_t id, int64_t at_ms, int attempt,
                                          const char *type, const char *data),
                             void *user, struct error *err) {
    sqlite3_stmt *stmt;
    store_lock(store);
    enum status status = sql_query(&store->sql, &stmt, err,
                                   "SELECT id, at_ms, attempt, type, data FROM events"
                                   " WHERE job_id = ? AND id > ? ORDER BY id LIMIT ?",
                                   "iii", job_id, after, (int64_t)limit);
    bool row = status == STATUS_OK;
    while (row) {
        status = sql_step(&store->sql, stmt, &row, err);
        if (row)
            each(user, sqlite3_column_int64(stmt, 0), sqlite3_column_int64(stmt, 1),
                 sqlite3_column_int(stmt, 2), sql_text(stmt, 3), sql_text(stmt, 4));
    }
    store_unlock(store);
    return status;
}

enum status store_event_last(struct store *store, int64_t job_id, int64_t *id, struct error *err) {
    store_lock(store);
    enum status status = sql_int(&store->sql, 0, id, err,
                                 "SELECT ifnull(max(id), 0) FROM events WHERE job_id = ?", "i",
                                 job_id);
    store_unlock(store);
    return status;
}
