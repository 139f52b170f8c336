/* webhooks.c -- what is to be told to whom outside: the outbox; see store.h.
 *
 * A message is made in the transaction of the change that it tells of, and goes when it was
 * delivered or given up: a crash in between repeats a message, and never loses one. */
#include <math.h>

#include "common/buf.h"
#include "common/json.h"
#include "common/mem.h"
#include "server/store/internal.h"
#include "server/store/store.h"

#define RETRY_FIRST_MS 2000.0 /* before a message is sent again; doubled each time */
#define RETRY_MAX_MS 600000.0 /* up to this */
#define TRIES 30              /* spread over four hours */

enum status store_webhook_set(struct store *store, int64_t job_id, const char *url, const char *secret,
                              struct error *err) {
    return sql_run(&store->sql, err, "INSERT INTO webhooks (job_id, url, secret) VALUES (?, ?, ?)", "itt", job_id, url,
                   secret);
}

enum status store_webhook_post(struct store *store, int64_t job_id, int attempt, const char *state, const char *reason,
                               const char *hint, struct error *err) {
    sqlite3_stmt *stmt;
    bool found = false;
    enum status status = sql_first(
        &store->sql, &stmt, &found, err,
        "SELECT url, secret, name, labels FROM webhooks JOIN jobs ON jobs.id = job_id WHERE job_id = ?", "i", job_id);
    if (!found)
        return status;
    char *url = sql_dup(stmt, 0), *secret = sql_dup(stmt, 1);
    cJSON *body = cJSON_CreateObject(), *job = cJSON_CreateObject(), *labels = cJSON_Parse(sql_text(stmt, 3));
    json_add_string(body, "type", "job.state");
    json_add_int(job, "id", job_id);
    json_add_string(job, "name", sql_text(stmt, 2));
    json_add_string(job, "state", state);
    json_add_int(job, "attempt", attempt);
    json_add_string(job, "reason", *reason ? reason : NULL);
    json_add_string(job, "hint", *hint ? hint : NULL);
    json_add(job, "labels", labels ? labels : cJSON_CreateObject());
    json_add(body, "data", job);
    sqlite3_reset(stmt);
    char *text = json_text(body);
    int64_t now = store_now_ms();
    status = sql_run(&store->sql, err, "INSERT INTO outbox (job_id, url, secret, body, next_ms) VALUES (?, ?, ?, ?, ?)",
                     "ittti", job_id, url, secret, text, now);
    mem_free(text);
    cJSON_Delete(body);
    mem_free(url);
    mem_free(secret);
    return status;
}

void outbox_row_release(struct outbox_row *row) {
    mem_free(row->url);
    mem_free(row->secret);
    mem_free(row->body);
    *row = (struct outbox_row){0};
}

enum status store_outbox_next(struct store *store, int64_t after, const int64_t *skip, size_t skip_count,
                              struct outbox_row *row, struct error *err) {
    sqlite3_stmt *stmt;
    bool found = false;
    *row = (struct outbox_row){0};
    /* A clock that was set back must not delay a message by more than its longest pause. */
    int64_t now = store_now_ms(), never = now + (int64_t)(2.0 * RETRY_MAX_MS);
    struct buf skipped;
    buf_init(&skipped, 4096);
    for (size_t i = 0; i < skip_count; i++)
        buf_printf(&skipped, "%s%lld", i ? "," : "[", (long long)skip[i]);
    buf_puts(&skipped, skip_count ? "]" : "[]");
    store_lock(store);
    enum status status =
        sql_first(&store->sql, &stmt, &found, err,
                  "SELECT outbox.id, job_id, url, secret, body, tries, ifnull(owner_id, 0) FROM outbox"
                  " LEFT JOIN jobs ON jobs.id = job_id"
                  " WHERE (next_ms <= ? OR next_ms > ?) AND outbox.id > ?"
                  " AND ifnull(owner_id, 0) NOT IN (SELECT value FROM json_each(?)) ORDER BY outbox.id LIMIT 1",
                  "iiit", now, never, after, buf_text(&skipped));
    if (found) {
        *row = (struct outbox_row){.id = sqlite3_column_int64(stmt, 0),
                                   .job_id = sqlite3_column_int64(stmt, 1),
                                   .url = sql_dup(stmt, 2),
                                   .secret = sql_dup(stmt, 3),
                                   .body = sql_dup(stmt, 4),
                                   .tries = sqlite3_column_int(stmt, 5),
                                   .owner_id = sqlite3_column_int64(stmt, 6)};
        sqlite3_reset(stmt);
    }
    store_unlock(store);
    buf_release(&skipped);
    return status == STATUS_OK && !found ? error_set(err, STATUS_NOT_FOUND, "the outbox has nothing to send") : status;
}

enum status store_outbox_wait(struct store *store, double *seconds, struct error *err) {
    int64_t next, now = store_now_ms();
    store_lock(store);
    enum status status = sql_int(&store->sql, -1, &next, err,
                                 "SELECT next_ms FROM outbox WHERE next_ms > ? ORDER BY next_ms LIMIT 1", "i", now);
    store_unlock(store);
    double wait = (double)(next - now) * 1e-3;
    *seconds = next < 0 ? (double)INFINITY : fmin(fmax(wait, 0.05), RETRY_MAX_MS * 1e-3);
    return status;
}

/* Records the outcome in the job; removed with it. */
static enum status note_outcome(struct store *store, int64_t id, const struct outbox_outcome *outcome, bool gave_up,
                                struct error *err) {
    return sql_run(
        &store->sql, err,
        "UPDATE webhooks SET result = ?, attempts = outbox.tries + 1, status = ?, error = ?, at_ms = ? FROM outbox"
        " WHERE outbox.id = ? AND webhooks.job_id = outbox.job_id",
        "tntii",
        outcome->delivered ? "delivered"
        : gave_up          ? "gave_up"
                           : "failed",
        outcome->status, outcome->reason ? outcome->reason : "", store_now_ms(), id);
}

static enum status settle(struct store *store, int64_t id, const struct outbox_outcome *outcome, bool *gave_up,
                          struct error *err) {
    int64_t tries;
    *gave_up = false;
    enum status status = store_begin_freeing(store, err);
    if (status != STATUS_OK)
        return status;
    status = sql_int(&store->sql, 0, &tries, err, "SELECT tries FROM outbox WHERE id = ?", "i", id);
    *gave_up = !outcome->delivered && (outcome->is_final || tries + 1 >= TRIES);
    double pause = fmin(RETRY_FIRST_MS * pow(2.0, (double)tries), RETRY_MAX_MS);
    if (status == STATUS_OK)
        status = note_outcome(store, id, outcome, *gave_up, err);
    if (status == STATUS_OK && (outcome->delivered || *gave_up))
        status = sql_run(&store->sql, err, "DELETE FROM outbox WHERE id = ?", "i", id);
    else if (status == STATUS_OK)
        status = sql_run(&store->sql, err, "UPDATE outbox SET tries = tries + 1, next_ms = ? WHERE id = ?", "ii",
                         store_now_ms() + (int64_t)pause, id);
    return store_end(store, status, STORE_NOTHING_CHANGED, err);
}

enum status store_outbox_settle(struct store *store, int64_t id, const struct outbox_outcome *outcome, bool *gave_up,
                                struct error *err) {
    enum status status;
    do
        status = settle(store, id, outcome, gave_up, err);
    while (status == STATUS_NO_SPACE && store_reserve_spend(store));
    return status;
}

/* Queues a message about the job's current state. */
static enum status post_present(struct store *store, int64_t job_id, struct error *err) {
    sqlite3_stmt *stmt;
    bool found = false;
    enum status status = sql_first(&store->sql, &stmt, &found, err,
                                   "SELECT attempt, state, reason, hint FROM jobs WHERE id = ?", "i", job_id);
    if (!found)
        return status;
    int attempt = sqlite3_column_int(stmt, 0);
    const char *state = job_state_name((enum job_state)sqlite3_column_int(stmt, 1));
    char *reason = sql_dup(stmt, 2), *hint = sql_dup(stmt, 3);
    sqlite3_reset(stmt);
    status = store_webhook_post(store, job_id, attempt, state, reason, hint, err);
    mem_free(reason);
    mem_free(hint);
    return status;
}

enum status store_webhook_again(struct store *store, int64_t job_id, struct error *err) {
    int64_t found = 0, waiting = 0;
    enum status status = store_begin(store, err);
    if (status != STATUS_OK)
        return status;
    status = sql_int(&store->sql, 0, &found, err, "SELECT 1 FROM webhooks WHERE job_id = ?", "i", job_id);
    if (status == STATUS_OK && !found)
        status = error_set(err, STATUS_CONFLICT, "job %lld has no webhook", (long long)job_id);
    if (status == STATUS_OK)
        status = sql_run(&store->sql, err, "UPDATE outbox SET tries = 0, next_ms = ? WHERE job_id = ?", "ii",
                         store_now_ms(), job_id);
    waiting = sql_changes(&store->sql);
    if (status == STATUS_OK && waiting == 0)
        status = post_present(store, job_id, err);
    return store_end(store, status, STORE_NOTHING_CHANGED, err);
}
