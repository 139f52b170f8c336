/* parts.c -- see parts.h. The transitions of parts are those of their attempts: attempts.c. */
#include "server/store/parts.h"

#include <stdio.h>
#include <string.h>

#include "common/json.h"
#include "common/mem.h"
#include "common/protocol.h"
#include "common/sha256.h"
#include "server/store/transition.h"

static enum status add_parts(struct store *store, int64_t id, int64_t pictures, int parts, const char *digest,
                             struct error *err) {
    enum status status = STATUS_OK;
    for (int64_t i = 0; i < parts && status == STATUS_OK; i++) {
        int64_t first = pictures / parts * i + pictures % parts * i / parts;
        int64_t next = pictures / parts * (i + 1) + pictures % parts * (i + 1) / parts;
        status =
            sql_run(&store->sql, err, "INSERT INTO parts (job_id, part, first, count, digest) VALUES (?, ?, ?, ?, ?)",
                    "iiiit", id, i + 1, first, next - first, digest);
    }
    return status;
}

static enum status split(struct store *store, int64_t id, int attempt, int64_t pictures, int parts, const char *digest,
                         struct error *err) {
    struct present now;
    int64_t others = 0;
    enum status status = attempt_begin_end(store, id, attempt, ENDING_SPLIT, &now, err);
    if (status != STATUS_OK)
        return status;
    status = sql_int(&store->sql, 0, &others, err, "SELECT count(*) FROM parts WHERE job_id = ?", "i", id);
    if (status == STATUS_OK && (now.part > 0 || others > 0))
        status = error_set(err, STATUS_CONFLICT, "job %lld is split already", (long long)id);
    if (status == STATUS_OK)
        status = add_parts(store, id, pictures, parts, digest, err);
    if (status == STATUS_OK)
        status = attempt_leave(store, &now, JOB_QUEUED, "", "", err);
    return store_end(store, status, id, err);
}

enum status store_job_split(struct store *store, int64_t id, int attempt, int64_t pictures, int parts,
                            const char *digest, struct error *err) {
    if (parts < 2 || parts > JOB_PARTS_MAX || pictures < parts || pictures > PICTURES_MAX || !sha256_is_hex(digest))
        return error_set(err, STATUS_INPUT, "%d parts of %lld pictures cannot be", parts, (long long)pictures);
    enum status status;
    do
        status = split(store, id, attempt, pictures, parts, digest, err);
    while (status == STATUS_NO_SPACE && store_reserve_spend(store));
    return status;
}

enum status store_part_of(struct store *store, int64_t id, int attempt, struct job_part *part, struct error *err) {
    sqlite3_stmt *stmt;
    bool found = false;
    *part = (struct job_part){0};
    store_lock(store);
    enum status status = sql_first(&store->sql, &stmt, &found, err,
                                   "SELECT a.part, ifnull(p.first, 0), ifnull(p.count, 0),"
                                   " (SELECT ifnull(sum(count), 0) FROM parts WHERE job_id = a.job_id),"
                                   " (SELECT ifnull(max(digest), '') FROM parts WHERE job_id = a.job_id)"
                                   " FROM attempts AS a LEFT JOIN parts AS p ON p.job_id = a.job_id AND p.part = a.part"
                                   " WHERE a.job_id = ? AND a.number = ?",
                                   "in", id, attempt);
    if (found) {
        *part = (struct job_part){.part = sqlite3_column_int(stmt, 0),
                                  .first = sqlite3_column_int64(stmt, 1),
                                  .count = sqlite3_column_int64(stmt, 2),
                                  .pictures = sqlite3_column_int64(stmt, 3)};
        snprintf(part->digest, sizeof part->digest, "%s", sql_text(stmt, 4));
        sqlite3_reset(stmt);
    }
    store_unlock(store);
    return status == STATUS_OK && !found
               ? error_set(err, STATUS_NOT_FOUND, "job %lld has no attempt %d", (long long)id, attempt)
               : status;
}

/* Inside a transaction: of all parts. The speeds of those that run add up. */
static enum status sum_parts(struct store *store, int64_t id, struct parts_progress *all, struct error *err) {
    sqlite3_stmt *stmt;
    bool found = false;
    double rate = 0.0;
    enum status status =
        sql_first(&store->sql, &stmt, &found, err,
                  "SELECT ifnull(sum(iif(state = 1, count, done)), 0.0), ifnull(sum(count), 0),"
                  " ifnull(sum(iif(part IN (SELECT part FROM attempts WHERE job_id = ?1 AND phase = 1),"
                  "  rate, 0.0)), 0.0) FROM parts WHERE job_id = ?1",
                  "i", id);
    if (found) {
        all->done = sqlite3_column_double(stmt, 0);
        all->total = sqlite3_column_double(stmt, 1);
        rate = sqlite3_column_double(stmt, 2);
        sqlite3_reset(stmt);
    }
    all->eta_sec = rate > 0.0 ? (all->total - all->done) / rate : -1.0;
    return status;
}

enum status store_part_progress(struct store *store, int64_t id, int attempt, double done, double eta_sec,
                                struct parts_progress *all, struct error *err) {
    enum status status = store_begin(store, err);
    *all = (struct parts_progress){.eta_sec = -1.0};
    if (status != STATUS_OK)
        return status;
    status = store_fence(store, id, attempt, err);
    if (status == STATUS_OK)
        status = sql_run(&store->sql, err,
                         "UPDATE parts SET done = max(0.0, min(?1, count)),"
                         " rate = iif(?2 > 0.0, (count - max(0.0, min(?1, count))) / ?2, 0.0)"
                         " WHERE job_id = ?3 AND part = (SELECT part FROM attempts WHERE job_id = ?3 AND number = ?4)",
                         "ddin", done, eta_sec, id, attempt);
    if (status == STATUS_OK)
        status = sum_parts(store, id, all, err);
    return store_end(store, status, STORE_NOTHING_CHANGED, err);
}

static enum status yield_once(struct store *store, int64_t id, const char *reason, struct error *err) {
    struct present now;
    int64_t running = 0;
    enum status status = transition_begin_stopping(store, id, &now, err);
    if (status != STATUS_OK)
        return status;
    status =
        sql_int(&store->sql, 0, &running, err, "SELECT count(*) FROM attempts WHERE job_id = ? AND phase = 1", "i", id);
    if (status == STATUS_OK && (now.state != JOB_RUNNING || running > 0))
        status = error_set(err, STATUS_CONFLICT, "job %lld is %s, with %lld attempts", (long long)id,
                           job_state_name(now.state), (long long)running);
    if (status == STATUS_OK)
        status = transition_move(store, &now, JOB_QUEUED, reason, "", err);
    return store_end(store, status, id, err);
}

enum status store_job_yield(struct store *store, int64_t id, const char *reason, struct error *err) {
    enum status status;
    do
        status = yield_once(store, id, reason, err);
    while (status == STATUS_NO_SPACE && store_reserve_spend(store));
    return status;
}

enum status store_attempts_wanted(struct store *store, int64_t *count, struct error *err) {
    store_lock(store);
    /* a queued job with parts counts by its open parts, any other as one */
    enum status status =
        sql_int(&store->sql, 0, count, err,
                "SELECT (SELECT count(*) FROM attempts WHERE phase = 1) +"
                " (SELECT count(*) FROM jobs WHERE state = 0"
                "  AND NOT EXISTS (SELECT 1 FROM parts WHERE job_id = jobs.id AND parts.state = 0)) +"
                " (SELECT count(*) FROM parts JOIN jobs ON jobs.id = parts.job_id"
                "  WHERE jobs.state < 2 AND parts.state = 0 AND NOT EXISTS (SELECT 1 FROM attempts"
                "  WHERE attempts.job_id = parts.job_id AND attempts.part = parts.part AND phase = 1))",
                "");
    store_unlock(store);
    return status;
}

/* --- for attempts.c -------------------------------------------------------------------------- */

static const char *const part_states[] = {
    [JOB_SUCCEEDED] =
        "UPDATE parts SET state = 1, done = count, reason = '', hint = '' WHERE job_id = ?1 AND part = ?2",
    [JOB_FAILED] = "UPDATE parts SET state = 2, reason = ?3, hint = ?4 WHERE job_id = ?1 AND part = ?2",
    [JOB_PAUSED] = "UPDATE parts SET state = 3, reason = ?3, hint = ?4 WHERE job_id = ?1 AND part = ?2"};

enum status part_end(struct store *store, const struct present *now, enum job_state to, const char *reason,
                     const char *hint, struct error *err) {
    if (to == JOB_QUEUED)
        return STATUS_OK;
    return to == JOB_SUCCEEDED ? sql_run(&store->sql, err, part_states[to], "in", now->id, now->part)
                               : sql_run(&store->sql, err, part_states[to], "intt", now->id, now->part, reason, hint);
}

enum status part_verdict(struct store *store, int64_t id, struct part_verdict *v, struct error *err) {
    sqlite3_stmt *stmt;
    bool found = false;
    *v = (struct part_verdict){.to = JOB_QUEUED};
    enum status status = sql_first(&store->sql, &stmt, &found, err,
                                   "SELECT part, state, reason, hint, (SELECT count(*) FROM parts WHERE job_id = ?1)"
                                   " FROM parts WHERE job_id = ?1 AND state > 1 ORDER BY state, part LIMIT 1",
                                   "i", id);
    if (found) {
        v->to = sqlite3_column_int(stmt, 1) == 2 ? JOB_FAILED : JOB_PAUSED;
        snprintf(v->reason, sizeof v->reason, "part %d of %d: %s", sqlite3_column_int(stmt, 0),
                 sqlite3_column_int(stmt, 4), sql_text(stmt, 2));
        snprintf(v->hint, sizeof v->hint, "%s", sql_text(stmt, 3));
        sqlite3_reset(stmt);
    }
    return status;
}

enum status part_append_event(struct store *store, const struct present *now, enum job_state to, const char *reason,
                              struct error *err) {
    int64_t count = 0;
    enum status status =
        sql_int(&store->sql, 0, &count, err, "SELECT count(*) FROM parts WHERE job_id = ?", "i", now->id);
    if (status != STATUS_OK || count == 0)
        return status;
    static const char *const what[] = {[JOB_QUEUED] = "is tried again",
                                       [JOB_SUCCEEDED] = "is done",
                                       [JOB_FAILED] = "has failed",
                                       [JOB_PAUSED] = "cannot go on"};
    cJSON *data = cJSON_CreateObject();
    char *message = now->part == 0 ? mem_printf("the pictures are rendered in %lld parts", (long long)count)
                                   : mem_printf("part %d of %lld %s%s%s", now->part, (long long)count, what[to],
                                                *reason ? ": " : "", reason);
    json_add_string(data, "level", to == JOB_SUCCEEDED || !*reason ? "info" : "warning");
    json_add_string(data, "message", message);
    char *text = json_text(data);
    status = store_event_append(store, now->id, now->attempt, EVENT_LOG, text, err);
    mem_free(text);
    mem_free(message);
    cJSON_Delete(data);
    return status;
}
