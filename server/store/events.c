/* events.c -- the events of jobs; see store.h. */
#include <math.h>
#include <string.h>

#include "common/json.h"
#include "common/protocol.h"
#include "server/store/internal.h"
#include "server/store/store.h"

#define PRUNE_EVERY 64 /* events by which a job may exceed its limit */

void store_keep_events(struct store *store, size_t per_job) { store->events_per_job = per_job; }

/* Removes a job's events up to `last`, and records that. */
static enum status prune_job(struct store *store, int64_t job_id, int64_t last, struct error *err) {
    enum status status =
        sql_run(&store->sql, err, "DELETE FROM events WHERE job_id = ? AND id <= ?", "ii", job_id, last);
    if (status == STATUS_OK)
        status =
            sql_run(&store->sql, err, "UPDATE jobs SET pruned_id = max(pruned_id, ?) WHERE id = ?", "ii", last, job_id);
    if (status == STATUS_OK)
        status = sql_run(&store->sql, err, "UPDATE pruned SET event_id = max(event_id, ?)", "i", last);
    return status;
}

/* Keeps the newest events_per_job. */
static enum status prune_excess(struct store *store, int64_t job_id, struct error *err) {
    int64_t last;
    enum status status = sql_int(&store->sql, 0, &last, err,
                                 "SELECT id FROM events WHERE job_id = ? ORDER BY id DESC"
                                 " LIMIT 1 OFFSET ?",
                                 "ii", job_id, (int64_t)store->events_per_job);
    return status == STATUS_OK && last > 0 ? prune_job(store, job_id, last, err) : status;
}

static enum status prune(struct store *store, int64_t before_ms, bool *more, struct error *err) {
    int64_t job_id, last;
    *more = false;
    enum status status = store_begin_freeing(store, err);
    if (status != STATUS_OK)
        return status;
    status = sql_int(&store->sql, 0, &job_id, err,
                     "SELECT id FROM jobs WHERE events_gone = 0 AND finished_ms > 0"
                     " AND finished_ms < ? ORDER BY finished_ms LIMIT 1",
                     "i", before_ms);
    if (status == STATUS_OK && job_id > 0) {
        *more = true;
        status = sql_int(&store->sql, 0, &last, err,
                         "SELECT id FROM events WHERE job_id = ? ORDER BY id DESC LIMIT 1 OFFSET 1", "i", job_id);
        if (status == STATUS_OK) /* ids start above 0 */
            status = prune_job(store, job_id, last, err);
        if (status == STATUS_OK)
            status = sql_run(&store->sql, err, "UPDATE jobs SET events_gone = 1 WHERE id = ?", "i", job_id);
    }
    return store_end(store, status, STORE_NOTHING_CHANGED, err);
}

enum status store_event_prune(struct store *store, int64_t before_ms, bool *more, struct error *err) {
    enum status status;
    do
        status = prune(store, before_ms, more, err);
    while (status == STATUS_NO_SPACE && store_reserve_spend(store));
    return status;
}

enum status store_event_append(struct store *store, int64_t job_id, int attempt, const char *type, const char *data,
                               struct error *err) {
    enum status status = sql_run(&store->sql, err,
                                 "INSERT INTO events (job_id, at_ms, attempt, type, data)"
                                 " VALUES (?, ?, ?, ?, ?)",
                                 "iintt", job_id, store_now_ms(), attempt, type, data);
    bool is_time = status == STATUS_OK && sqlite3_last_insert_rowid(store->sql.db) % PRUNE_EVERY == 0;
    return is_time ? prune_excess(store, job_id, err) : status;
}

enum status store_fence(struct store *store, int64_t job_id, int attempt, struct error *err) {
    int64_t runs;
    enum status status = sql_int(&store->sql, -1, &runs, err,
                                 "SELECT state = ?2 AND EXISTS (SELECT 1 FROM attempts WHERE job_id = ?1"
                                 " AND number = ?3 AND phase <> ?4) FROM jobs WHERE id = ?1",
                                 "innn", job_id, (int)JOB_RUNNING, attempt, (int)ATTEMPT_ROW_ENDED);
    if (status != STATUS_OK)
        return status;
    if (runs < 0)
        return error_set(err, STATUS_NOT_FOUND, "there is no job %lld", (long long)job_id);
    if (!runs)
        return error_set(err, STATUS_CONFLICT, "attempt %d of job %lld is over", attempt, (long long)job_id);
    return STATUS_OK;
}

/* Copies the progress of an event into the job's row. */
static enum status update_progress(struct store *store, int64_t job_id, const char *data, struct error *err) {
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
                         "tddi", stage, total > 0.0 ? fmin(fmax(done / total, 0.0), 1.0) : 0.0, eta_sec, job_id);
    cJSON_Delete(object);
    return status;
}

enum status store_event_add(struct store *store, int64_t job_id, int attempt, const char *type, const char *data,
                            struct error *err) {
    enum status status = store_begin(store, err);
    if (status != STATUS_OK)
        return status;
    status = store_fence(store, job_id, attempt, err);
    if (status == STATUS_OK && strcmp(type, EVENT_PROGRESS) == 0) {
        status = update_progress(store, job_id, data, err);
        if (status == STATUS_OK)
            status =
                sql_run(&store->sql, err, "DELETE FROM events WHERE job_id = ? AND type = 'progress'", "i", job_id);
    }
    if (status == STATUS_OK)
        status = store_event_append(store, job_id, attempt, type, data, err);
    return store_end(store, status, job_id, err);
}

enum status store_event_list(struct store *store, int64_t job_id, int64_t after, size_t limit,
                             void (*each)(void *user, int64_t id, int64_t at_ms, int attempt, const char *type,
                                          const char *data),
                             void *user, struct error *err) {
    sqlite3_stmt *stmt;
    store_lock(store);
    enum status status = sql_query(&store->sql, &stmt, err,
                                   "SELECT id, at_ms, attempt, type, data FROM events"
                                   " WHERE job_id = ? AND id > ? ORDER BY id LIMIT ?",
                                   "iii", job_id, after, (int64_t)limit);
    while (sql_next(&store->sql, stmt, &status, err))
        each(user, sqlite3_column_int64(stmt, 0), sqlite3_column_int64(stmt, 1), sqlite3_column_int(stmt, 2),
             sql_text(stmt, 3), sql_text(stmt, 4));
    store_unlock(store);
    return status;
}

/* Fills the page's facts about the job, if `who` may read it. */
static enum status page_of_job(struct store *store, const struct caller *who, int64_t job_id, struct event_page *page,
                               struct error *err) {
    sqlite3_stmt *stmt;
    bool found = false;
    enum status status = sql_first(
        &store->sql, &stmt, &found, err,
        "SELECT state, pruned_id, revision, owner_id, shared FROM jobs WHERE id = ? AND (? OR owner_id = ? OR shared)",
        "ini", job_id, who == NULL || who->role == ROLE_ADMIN, who ? who->user_id : 0);
    if (found) {
        page->state = (enum job_state)sqlite3_column_int(stmt, 0);
        page->pruned_id = sqlite3_column_int64(stmt, 1);
        page->revision = sqlite3_column_int64(stmt, 2);
        page->owner_id = sqlite3_column_int64(stmt, 3);
        page->is_shared = sqlite3_column_int(stmt, 4) != 0;
        sqlite3_reset(stmt);
    }
    return status == STATUS_OK && !found ? error_set(err, STATUS_NOT_FOUND, "there is no job %lld", (long long)job_id)
                                         : status;
}

static enum status page_of_all(struct store *store, struct event_page *page, struct error *err) {
    return sql_int(&store->sql, 0, &page->pruned_id, err, "SELECT event_id FROM pruned", "");
}

static enum status page_query(struct store *store, const struct caller *who, int64_t job_id, int64_t after,
                              size_t limit, sqlite3_stmt **stmt, struct error *err) {
    if (job_id > 0)
        return sql_query(&store->sql, stmt, err,
                         "SELECT id, at_ms, attempt, type, data, job_id FROM events"
                         " WHERE job_id = ? AND id > ? ORDER BY id LIMIT ?",
                         "iii", job_id, after, (int64_t)limit);
    if (!who || who->role == ROLE_ADMIN)
        return sql_query(&store->sql, stmt, err,
                         "SELECT id, at_ms, attempt, type, data, job_id FROM events"
                         " WHERE id > ? ORDER BY id LIMIT ?",
                         "ii", after, (int64_t)limit);
    return sql_query(&store->sql, stmt, err,
                     "SELECT events.id, at_ms, events.attempt, type, data, job_id FROM events"
                     " CROSS JOIN jobs ON jobs.id = job_id"
                     " WHERE events.id > ? AND (owner_id = ? OR shared) ORDER BY events.id LIMIT ?",
                     "iii", after, who->user_id, (int64_t)limit);
}

enum status store_event_page(struct store *store, const struct caller *who, int64_t job_id, int64_t after, size_t limit,
                             size_t byte_limit, void (*each)(void *user, const struct event_row *row), void *user,
                             struct event_page *page, struct error *err) {
    sqlite3_stmt *stmt = NULL;
    size_t bytes = 0;
    *page = (struct event_page){.last_id = after};
    store_lock(store);
    enum status status = job_id > 0 ? page_of_job(store, who, job_id, page, err) : page_of_all(store, page, err);
    if (status == STATUS_OK)
        status = page_query(store, who, job_id, after, limit, &stmt, err);
    while (sql_next(&store->sql, stmt, &status, err)) {
        struct event_row event = {.id = sqlite3_column_int64(stmt, 0),
                                  .job_id = sqlite3_column_int64(stmt, 5),
                                  .at_ms = sqlite3_column_int64(stmt, 1),
                                  .attempt = sqlite3_column_int(stmt, 2),
                                  .type = sql_text(stmt, 3),
                                  .data = sql_text(stmt, 4)};
        bytes += strlen(event.data);
        page->last_id = event.id;
        page->count++;
        each(user, &event);
        if (bytes >= byte_limit) {
            sqlite3_reset(stmt);
            break;
        }
    }
    page->is_full = page->count == limit || bytes >= byte_limit;
    /* Events of others after the last of the caller's are not read again. */
    if (status == STATUS_OK && !page->is_full && job_id == 0)
        status = sql_int(&store->sql, after, &page->last_id, err, "SELECT max(?, ifnull(max(id), 0)) FROM events", "i",
                         page->last_id);
    store_unlock(store);
    return status;
}

enum status store_event_last(struct store *store, int64_t job_id, int64_t *id, struct error *err) {
    store_lock(store);
    enum status status = job_id > 0 ? sql_int(&store->sql, 0, id, err,
                                              "SELECT ifnull(max(id), 0) FROM events WHERE job_id = ?", "i", job_id)
                                    : sql_int(&store->sql, 0, id, err, "SELECT ifnull(max(id), 0) FROM events", "");
    store_unlock(store);
    return status;
}

enum status store_event_newest(struct store *store, int64_t *id, struct error *err) {
    store_lock(store);
    enum status status = sql_int(&store->sql, 0, id, err, "SELECT seq FROM sqlite_sequence WHERE name = 'events'", "");
    store_unlock(store);
    return status;
}
