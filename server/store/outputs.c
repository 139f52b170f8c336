/* outputs.c -- the files that jobs have finished writing; see store.h.
 *
 * Names come from a worker, which has parsed an untrusted upload, and become parts of paths: only plain
 * relative ones are accepted. */
#include "server/store/outputs.h"

#include <ctype.h>
#include <stdio.h>
#include <string.h>

#include "common/json.h"
#include "common/mem.h"
#include "common/sha256.h"
#include "server/store/internal.h"

#define COLUMNS                                                                                                        \
    "name, bytes, sha256, content_type, updated_ms, attempt, digest, digest_inode, digest_bytes, digest_modified_ns,"  \
    " digest_changed_ns"

static void fill(struct output_row *row, sqlite3_stmt *stmt) {
    *row = (struct output_row){
        .name = sql_dup(stmt, 0),
        .bytes = (uint64_t)sqlite3_column_int64(stmt, 1),
        .content_type = sql_dup(stmt, 3),
        .updated_ms = sqlite3_column_int64(stmt, 4),
        .attempt = sqlite3_column_int(stmt, 5),
        .version = {(uint64_t)sqlite3_column_int64(stmt, 7), (uint64_t)sqlite3_column_int64(stmt, 8),
                    sqlite3_column_int64(stmt, 9), sqlite3_column_int64(stmt, 10)},
    };
    snprintf(row->sha256, sizeof row->sha256, "%s", sql_text(stmt, 2));
    snprintf(row->digest, sizeof row->digest, "%s", sql_text(stmt, 6));
}

void output_row_release(struct output_row *row) {
    mem_free(row->name);
    mem_free(row->content_type);
    *row = (struct output_row){0};
}

bool store_output_is_name(const char *name) {
    size_t length = strlen(name);
    if (length == 0 || length > 200)
        return false;
    for (size_t i = 0; i < length; i++) {
        bool at_start = i == 0 || name[i - 1] == '/';
        if (!isalnum((unsigned char)name[i]) && !strchr("_-./", name[i]))
            return false;
        if (at_start && (name[i] == '.' || name[i] == '/'))
            return false;
    }
    return name[length - 1] != '/';
}

void store_on_digest_wanted(struct store *store, void (*wanted)(void *user), void *user) {
    store->digest_wanted = wanted;
    store->digest_wanted_user = user;
}

static enum status tell_wanted(const struct store *store, enum status status) {
    if (status == STATUS_OK && store->digest_wanted)
        store->digest_wanted(store->digest_wanted_user);
    return status;
}

enum status store_output_put(struct store *store, int64_t job_id, int attempt, const char *type, const char *name,
                             uint64_t bytes, const char *sha256, const char *content_type, struct error *err) {
    if (!store_output_is_name(name))
        return error_set(err, STATUS_INPUT, "\"%.100s\" is no name for an output", name);
    if (!sha256_is_hex(sha256))
        return error_set(err, STATUS_INPUT, "output %s: \"%.70s\" is no SHA-256", name, sha256);
    enum status status = store_begin(store, err);
    if (status != STATUS_OK)
        return status;
    status = store_fence(store, job_id, attempt, err);
    if (status == STATUS_OK)
        status = sql_run(&store->sql, err,
                         "INSERT OR REPLACE INTO outputs (job_id, name, bytes, sha256,"
                         " content_type, updated_ms, attempt, digest_wanted) VALUES (?, ?, ?, ?, ?, ?, ?, 1)",
                         "itittin", job_id, name, (int64_t)bytes, sha256, content_type, store_now_ms(), attempt);
    if (status == STATUS_OK) {
        cJSON *data = cJSON_CreateObject();
        json_add_string(data, "name", name);
        json_add_int(data, "bytes", (int64_t)bytes);
        json_add_string(data, "sha256", sha256);
        json_add_string(data, "content_type", content_type);
        char *text = json_text(data);
        status = store_event_append(store, job_id, attempt, type, text, err);
        mem_free(text);
        cJSON_Delete(data);
    }
    return tell_wanted(store, store_end(store, status, job_id, err));
}

enum status store_output_get(struct store *store, int64_t job_id, const char *name, struct output_row *row,
                             struct error *err) {
    sqlite3_stmt *stmt;
    bool found = false;
    *row = (struct output_row){0};
    store_lock(store);
    enum status status = sql_first(&store->sql, &stmt, &found, err,
                                   "SELECT " COLUMNS " FROM outputs WHERE job_id = ? AND name = ?", "it", job_id, name);
    if (found) {
        fill(row, stmt);
        sqlite3_reset(stmt);
    }
    store_unlock(store);
    return status == STATUS_OK && !found
               ? error_set(err, STATUS_NOT_FOUND, "job %lld has no output %.200s", (long long)job_id, name)
               : status;
}

enum status store_output_list(struct store *store, int64_t job_id, struct output_row **rows, size_t *count,
                              struct error *err) {
    sqlite3_stmt *stmt;
    size_t capacity = 0;
    *rows = NULL;
    *count = 0;
    store_lock(store);
    enum status status = sql_query(&store->sql, &stmt, err,
                                   "SELECT " COLUMNS " FROM outputs WHERE job_id = ? ORDER BY name", "i", job_id);
    while (sql_next(&store->sql, stmt, &status, err)) {
        if (*count == capacity) {
            capacity = capacity ? capacity * 2 : 16;
            *rows = mem_realloc_array(*rows, capacity, sizeof **rows);
        }
        fill(&(*rows)[(*count)++], stmt);
    }
    store_unlock(store);
    if (status != STATUS_OK) {
        while (*count > 0)
            output_row_release(&(*rows)[--*count]);
        mem_free(*rows);
        *rows = NULL;
    }
    return status;
}

/* --- digests ----------------------------------------------------------------------------- */

enum status store_output_want_digest(struct store *store, int64_t job_id, const char *name, struct error *err) {
    enum status status = store_begin(store, err);
    if (status != STATUS_OK)
        return status;
    status = sql_run(&store->sql, err,
                     "UPDATE outputs SET digest_wanted = 1 WHERE job_id = ? AND name = ? AND digest_wanted = 0", "it",
                     job_id, name);
    return tell_wanted(store, store_end(store, status, STORE_NOTHING_CHANGED, err));
}

enum status store_output_next_digest(struct store *store, int64_t *job_id, struct output_row *row, struct error *err) {
    sqlite3_stmt *stmt;
    bool found = false;
    *row = (struct output_row){0};
    store_lock(store);
    enum status status = sql_first(&store->sql, &stmt, &found, err,
                                   "SELECT " COLUMNS ", job_id FROM outputs WHERE digest_wanted = 1"
                                   " ORDER BY bytes LIMIT 1",
                                   "");
    if (found) {
        fill(row, stmt);
        *job_id = sqlite3_column_int64(stmt, 11);
        sqlite3_reset(stmt);
    }
    store_unlock(store);
    return status == STATUS_OK && !found ? error_set(err, STATUS_NOT_FOUND, "every output has its digest") : status;
}

enum status store_output_enter_digest(struct store *store, int64_t job_id, const struct output_row *row,
                                      const struct file_version *version, const char *digest, struct error *err) {
    static const struct file_version none = {0};
    const struct file_version *v = version ? version : &none;
    enum status status = store_begin(store, err);
    if (status != STATUS_OK)
        return status;
    status = sql_run(&store->sql, err,
                     "UPDATE outputs SET digest_wanted = 0, digest = ?, digest_inode = ?, digest_bytes = ?,"
                     " digest_modified_ns = ?, digest_changed_ns = ?"
                     " WHERE job_id = ? AND name = ? AND attempt = ? AND updated_ms = ? AND sha256 = ?",
                     "tiiiiitnit", digest ? digest : "", (int64_t)v->inode, (int64_t)v->bytes, v->modified_ns,
                     v->changed_ns, job_id, row->name, row->attempt, row->updated_ms, row->sha256);
    return store_end(store, status, STORE_NOTHING_CHANGED, err);
}
