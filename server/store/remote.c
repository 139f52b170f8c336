/* remote.c -- see remote.h. This file is the scheduler's side and what both sides share; remote_node.c is the
 * node's. */
#include "server/store/remote.h"

#include <stdio.h>
#include <string.h>

#include "common/mem.h"
#include "common/protocol.h"
#include "server/store/internal.h"
#include "server/store/transition.h"

#define COLUMNS                                                                                                        \
    "job_id, number, phase, executor, name, external_id, external_reason, host, lease_sec, begun_ms, claimed_ms,"      \
    " heard_ms, heard_count, refused_count, last_seq, wanted, cpu_sec, end_way, end_code, end_reason, end_words"

const char *remote_request_name(enum remote_request request) {
    static const char *const names[] = {"go_on", "preview", "stop", "cancel"};
    return names[request];
}

#define COPY(to, column) snprintf(to, sizeof(to), "%s", sql_text(stmt, column))

static void fill(struct remote_row *row, sqlite3_stmt *stmt) {
    *row = (struct remote_row){.job_id = sqlite3_column_int64(stmt, 0),
                               .number = sqlite3_column_int(stmt, 1),
                               .phase = (enum remote_phase)sqlite3_column_int(stmt, 2),
                               .lease_sec = sqlite3_column_int(stmt, 8),
                               .begun_ms = sqlite3_column_int64(stmt, 9),
                               .claimed_ms = sqlite3_column_int64(stmt, 10),
                               .heard_ms = sqlite3_column_int64(stmt, 11),
                               .heard_count = sqlite3_column_int64(stmt, 12),
                               .refused_count = sqlite3_column_int64(stmt, 13),
                               .last_seq = sqlite3_column_int64(stmt, 14),
                               .wanted = (enum remote_request)sqlite3_column_int(stmt, 15),
                               .cpu_sec = sqlite3_column_double(stmt, 16)};
    COPY(row->executor, 3);
    COPY(row->name, 4);
    COPY(row->external_id, 5);
    COPY(row->external_reason, 6);
    COPY(row->host, 7);
    COPY(row->end.way, 17);
    row->end.code = sqlite3_column_int(stmt, 18);
    COPY(row->end.reason, 19);
    COPY(row->end.log_tail, 20);
}

enum status remote_row_read(struct store *store, int64_t job_id, int number, struct remote_row *row,
                            struct error *err) {
    sqlite3_stmt *stmt;
    bool found = false;
    enum status status =
        sql_first(&store->sql, &stmt, &found, err,
                  "SELECT " COLUMNS " FROM remote WHERE job_id = ? AND part = 0 AND number = ?", "in", job_id, number);
    if (found) {
        fill(row, stmt);
        sqlite3_reset(stmt);
    } else if (status == STATUS_OK) {
        status =
            error_set(err, STATUS_NOT_FOUND, "attempt %d of job %lld runs nowhere else", number, (long long)job_id);
    }
    return status;
}

enum status store_remote_get(struct store *store, int64_t job_id, int number, struct remote_row *row,
                             struct error *err) {
    store_lock(store);
    enum status status = remote_row_read(store, job_id, number, row, err);
    store_unlock(store);
    return status;
}

enum status store_remote_list(struct store *store, const char *executor, struct remote_row **rows, size_t *count,
                              struct error *err) {
    sqlite3_stmt *stmt;
    size_t room = 0;
    *rows = NULL;
    *count = 0;
    store_lock(store);
    enum status status =
        sql_query(&store->sql, &stmt, err,
                  "SELECT " COLUMNS " FROM remote WHERE phase < 3 AND (?1 IS NULL OR executor = ?1)", "t", executor);
    bool is_row = status == STATUS_OK;
    while (is_row) {
        status = sql_step(&store->sql, stmt, &is_row, err);
        if (!is_row)
            break;
        if (*count == room) {
            room = room ? 2 * room : 16;
            *rows = mem_realloc_array(*rows, room, sizeof **rows);
        }
        fill(&(*rows)[(*count)++], stmt);
    }
    store_unlock(store);
    if (status != STATUS_OK) {
        mem_free(*rows);
        *rows = NULL;
        *count = 0;
    }
    return status;
}

uint64_t store_remote_changes(struct store *store) { return atomic_load(&store->remote.changes); }

enum status store_remote_begin(struct store *store, const struct remote_row *row, const char *token_sha256,
                               struct error *err) {
    enum status status = store_begin(store, err);
    if (status != STATUS_OK)
        return status;
    status = store_fence(store, row->job_id, row->number, err);
    if (status == STATUS_OK)
        status = sql_run(&store->sql, err,
                         "INSERT INTO remote (job_id, number, executor, name, phase, token_sha256, lease_sec, begun_ms)"
                         " VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
                         "inttntni", row->job_id, row->number, row->executor, row->name, (int)REMOTE_SUBMITTING,
                         token_sha256, row->lease_sec, store_now_ms());
    return store_end(store, status, STORE_NOTHING_CHANGED, err);
}

enum status store_remote_rename(struct store *store, int64_t job_id, int number, const char *name,
                                const char *token_sha256, struct error *err) {
    enum status status = store_begin(store, err);
    if (status != STATUS_OK)
        return status;
    status = store_fence(store, job_id, number, err);
    if (status == STATUS_OK)
        status = sql_run(&store->sql, err,
                         "UPDATE remote SET name = ?, token_sha256 = ?, external_id = ''"
                         " WHERE job_id = ? AND part = 0 AND number = ? AND phase < ?",
                         "ttinn", name, token_sha256, job_id, number, (int)REMOTE_CLAIMED);
    if (status == STATUS_OK && sql_changes(&store->sql) == 0)
        status = error_set(err, STATUS_CONFLICT, "attempt %d of job %lld is claimed", number, (long long)job_id);
    return store_end(store, status, STORE_NOTHING_CHANGED, err);
}

enum status store_remote_submitted(struct store *store, int64_t job_id, int number, const char *external_id,
                                   struct error *err) {
    enum status status = store_begin(store, err);
    if (status != STATUS_OK)
        return status;
    status = sql_run(&store->sql, err,
                     "UPDATE remote SET external_id = ?, phase = max(phase, ?)"
                     " WHERE job_id = ? AND part = 0 AND number = ?",
                     "tnin", external_id, (int)REMOTE_WAITING, job_id, number);
    return store_end(store, status, STORE_NOTHING_CHANGED, err);
}

/* Inside a transaction: the reason that a running job shows. */
static enum status tell_job(struct store *store, int64_t job_id, const char *reason, struct error *err) {
    struct present now;
    enum status status = transition_read(store, job_id, &now, err);
    if (status == STATUS_OK)
        status =
            sql_run(&store->sql, err,
                    "UPDATE jobs SET revision = revision + 1, reason = ?1, hint = '' WHERE id = ?2 AND reason <> ?1",
                    "ti", reason, job_id);
    return status == STATUS_OK && sql_changes(&store->sql) > 0 ? transition_append_event(store, &now, reason, "", err)
                                                               : status;
}

/* The wait in the site's queue is none of the job's running time. One that is split began with its first attempt. */
enum status remote_tell_begun(struct store *store, int64_t job_id, struct error *err) {
    enum status status = sql_run(&store->sql, err,
                                 "UPDATE jobs SET revision = revision + 1, started_ms = ? WHERE id = ?"
                                 " AND NOT EXISTS (SELECT 1 FROM parts WHERE job_id = jobs.id)",
                                 "ii", store_now_ms(), job_id);
    return status == STATUS_OK ? tell_job(store, job_id, "", err) : status;
}

enum status store_remote_explain(struct store *store, int64_t job_id, int number, const char *reason,
                                 struct error *err) {
    struct remote_row row = {0};
    int64_t others = 0;
    char text[192];
    enum status status = store_begin(store, err);
    if (status != STATUS_OK)
        return status;
    status = store_fence(store, job_id, number, err);
    if (status == STATUS_OK)
        status = remote_row_read(store, job_id, number, &row, err);
    /* "-" is none known: the first one is told even if the site gives no reason */
    bool is_same = row.external_reason[0] && strcmp(row.external_reason, reason[0] ? reason : "-") == 0;
    if (status != STATUS_OK || row.phase >= REMOTE_CLAIMED || is_same)
        return store_end(store, status, STORE_NOTHING_CHANGED, err);
    snprintf(text, sizeof text, JOB_WAITING_IN "%s%s%.120s", row.executor, reason[0] ? ": " : "", reason);
    status =
        sql_run(&store->sql, err, "UPDATE remote SET external_reason = ? WHERE job_id = ? AND part = 0 AND number = ?",
                "tin", reason[0] ? reason : "-", job_id, number);
    if (status == STATUS_OK) /* while another part of the job runs it does not wait */
        status = sql_int(&store->sql, 0, &others, err,
                         "SELECT count(*) FROM attempts WHERE job_id = ? AND number <> ? AND attempts.phase = 1", "in",
                         job_id, number);
    if (status == STATUS_OK && others == 0)
        status = tell_job(store, job_id, text, err);
    return store_end(store, status, job_id, err);
}

struct requested {
    int64_t job_id;
    int number;
    enum remote_request request;
};

static enum status enter_request(struct store *store, void *what, int64_t *changed_job, struct error *err) {
    const struct requested *w = what;
    (void)changed_job; /* no subscriber sees it */
    return sql_run(&store->sql, err,
                   "UPDATE remote SET wanted = ?1, told_seq = 0"
                   " WHERE job_id = ?2 AND part = 0 AND number = ?3 AND wanted < ?1 AND phase < 3",
                   "nin", (int)w->request, w->job_id, w->number);
}

enum status store_remote_trouble(struct store *store, int64_t job_id, int number, const char *reason,
                                 struct error *err) {
    struct remote_row row = {0};
    enum status status = store_begin(store, err);
    if (status != STATUS_OK)
        return status;
    status = store_fence(store, job_id, number, err);
    if (status == STATUS_OK)
        status = remote_row_read(store, job_id, number, &row, err);
    bool is_told = status == STATUS_OK && row.phase == REMOTE_CLAIMED;
    if (is_told)
        status = tell_job(store, job_id, reason, err);
    return store_end(store, status, is_told ? job_id : STORE_NOTHING_CHANGED, err);
}

enum status store_remote_request(struct store *store, int64_t job_id, int number, enum remote_request request,
                                 struct error *err) {
    struct requested requested = {job_id, number, request};
    return store_change_freeing(store, enter_request, &requested, err);
}

/* Under the mutex: the oldest report. */
static enum status next_report(struct store *store, int64_t job_id, int number, int64_t *seq, char **lines,
                               struct error *err) {
    sqlite3_stmt *stmt;
    bool found = false;
    enum status status = sql_first(&store->sql, &stmt, &found, err,
                                   "SELECT seq, lines FROM attempt_lines"
                                   " WHERE job_id = ? AND part = 0 AND number = ? ORDER BY seq LIMIT 1",
                                   "in", job_id, number);
    if (found) {
        *seq = sqlite3_column_int64(stmt, 0);
        *lines = sql_dup(stmt, 1);
        sqlite3_reset(stmt);
    }
    return status == STATUS_OK && !found ? error_set(err, STATUS_NOT_FOUND, "every report has been read") : status;
}

static enum status read_once(struct store *store, int64_t job_id, int number, remote_lines_fn *each, void *user,
                             struct error *err) {
    int64_t seq = 0;
    char *lines = NULL;
    enum status status = store_group_begin(store, err);
    if (status != STATUS_OK)
        return status;
    status = next_report(store, job_id, number, &seq, &lines, err);
    if (status == STATUS_OK) {
        each(user, lines);
        status = sql_run(&store->sql, err,
                         "DELETE FROM attempt_lines WHERE job_id = ? AND part = 0 AND number = ? AND seq = ?", "ini",
                         job_id, number, seq);
    }
    mem_free(lines);
    return store_group_end(store, status, err);
}

enum status store_remote_read(struct store *store, int64_t job_id, int number, remote_lines_fn *each, void *user,
                              struct error *err) {
    enum status status;
    do
        status = read_once(store, job_id, number, each, user, err);
    while (status == STATUS_NO_SPACE && store_reserve_spend(store));
    return status;
}

struct closed {
    int64_t job_id;
    int number;
    size_t writers;
};

static enum status enter_closed(struct store *store, void *what, int64_t *changed_job, struct error *err) {
    struct closed *c = what;
    (void)changed_job;
    c->writers = remote_writer_count(store, c->job_id, c->number);
    return sql_run(&store->sql, err,
                   "UPDATE remote SET phase = 3 WHERE job_id = ? AND part = 0 AND number = ? AND phase < 3", "in",
                   c->job_id, c->number);
}

enum status store_remote_close(struct store *store, int64_t job_id, int number, size_t *writers, struct error *err) {
    struct closed closed = {.job_id = job_id, .number = number};
    enum status status = store_change_freeing(store, enter_closed, &closed, err);
    *writers = closed.writers;
    return status;
}
