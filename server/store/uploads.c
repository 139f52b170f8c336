/* uploads.c -- the rows of resumable uploads; see store.h. The bytes are in files; a row says how many of them are
 * reliable. */
#include "server/store/uploads.h"

#include <stdio.h>
#include <string.h>

#include "common/mem.h"
#include "server/store/internal.h"

#define COLUMNS                                                                                                        \
    "id, name, metadata, sha256, length, received, boot, scene_id, created_ms, updated_ms, hash,"                      \
    " owner_id, (SELECT name FROM users WHERE users.id = owner_id), pinned, " UPLOAD_EXPIRES ", reading"

static void fill(struct upload_row *row, sqlite3_stmt *stmt) {
    *row = (struct upload_row){
        .owner_id = sqlite3_column_int64(stmt, 11),
        .owner = sql_dup(stmt, 12),
        .name = sql_dup(stmt, 1),
        .metadata = sql_dup(stmt, 2),
        .length = (uint64_t)sqlite3_column_int64(stmt, 4),
        .received = (uint64_t)sqlite3_column_int64(stmt, 5),
        .created_ms = sqlite3_column_int64(stmt, 8),
        .updated_ms = sqlite3_column_int64(stmt, 9),
        .is_pinned = sqlite3_column_int(stmt, 13) != 0,
        .expires_ms = sqlite3_column_int64(stmt, 14),
        .reading = sql_dup(stmt, 15),
    };
    snprintf(row->id, sizeof row->id, "%s", sql_text(stmt, 0));
    snprintf(row->sha256, sizeof row->sha256, "%s", sql_text(stmt, 3));
    snprintf(row->boot, sizeof row->boot, "%s", sql_text(stmt, 6));
    snprintf(row->scene_id, sizeof row->scene_id, "%s", sql_text(stmt, 7));
}

void upload_row_release(struct upload_row *row) {
    mem_free(row->owner);
    mem_free(row->name);
    mem_free(row->metadata);
    mem_free(row->reading);
    *row = (struct upload_row){0};
}

static enum status not_found(const char *id, struct error *err) {
    return error_set(err, STATUS_NOT_FOUND, "there is no upload %s", id);
}

/* Ends a transaction of one statement; where it changed no row: not found. */
static enum status end_change(struct store *store, enum status status, const char *id, struct error *err) {
    if (status == STATUS_OK && sql_changes(&store->sql) == 0)
        status = not_found(id, err);
    return store_end(store, status, STORE_NOTHING_CHANGED, err);
}

enum status store_upload_add(struct store *store, const struct upload_row *row, const void *hash, size_t hash_size,
                             const struct count_limits *limits, struct error *err) {
    int64_t count, mine = 0, now = store_now_ms();
    enum status status = store_begin(store, err);
    if (status != STATUS_OK)
        return status;
    status = sql_int(&store->sql, 0, &count, err, "SELECT count(*) FROM uploads WHERE scene_id = ''", "");
    if (status == STATUS_OK && (uint64_t)count >= limits->all)
        status = error_set(err, STATUS_LIMIT, "%lld uploads are under way already, the limit is %zu", (long long)count,
                           limits->all);
    if (status == STATUS_OK && limits->one_user > 0 && row->owner_id > 0)
        status = sql_int(&store->sql, 0, &mine, err,
                         "SELECT count(*) FROM uploads WHERE scene_id = '' AND owner_id = ?", "i", row->owner_id);
    if (status == STATUS_OK && mine > 0 && (uint64_t)mine >= limits->one_user) {
        error_set(err, STATUS_LIMIT, "%lld of your uploads are under way already, and one user may have %zu",
                  (long long)mine, limits->one_user);
        status = error_hint(err, "finish or remove some; an administrator can raise the option user_max_uploads");
    }
    if (status == STATUS_OK)
        status = sql_run(&store->sql, err,
                         "INSERT INTO uploads (id, owner_id, name, metadata, sha256, length, hash, boot,"
                         " created_ms, updated_ms, reading) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
                         "titttibtiit", row->id, row->owner_id, row->name, row->metadata, row->sha256,
                         (int64_t)row->length, hash, hash_size, row->boot, now, now, row->reading ? row->reading : "");
    return store_end(store, status, STORE_NOTHING_CHANGED, err);
}

enum status store_upload_get(struct store *store, const char *id, struct upload_row *row, void *hash, size_t hash_size,
                             struct error *err) {
    sqlite3_stmt *stmt;
    bool found = false;
    *row = (struct upload_row){0};
    store_lock(store);
    enum status status =
        sql_first(&store->sql, &stmt, &found, err, "SELECT " COLUMNS " FROM uploads WHERE id = ?", "t", id);
    if (found) {
        fill(row, stmt);
        if (hash && (size_t)sqlite3_column_bytes(stmt, 10) == hash_size)
            memcpy(hash, sqlite3_column_blob(stmt, 10), hash_size);
        else if (hash)
            status =
                error_set(err, STATUS_CORRUPT, "the hash state of upload %s is of another version of the program", id);
        sqlite3_reset(stmt);
    }
    store_unlock(store);
    if (status != STATUS_OK)
        upload_row_release(row);
    return status == STATUS_OK && !found ? not_found(id, err) : status;
}

enum status store_upload_list(struct store *store, const struct caller *who, const char *sha256, const char *cursor,
                              size_t limit, struct upload_row *rows, size_t *count, char next_cursor[128],
                              struct error *err) {
    bool sees_all = !who || who->role == ROLE_ADMIN;
    long long before_ms = INT64_MAX;
    char before_id[UPLOAD_ID_SIZE] = "", rest;
    *count = 0;
    next_cursor[0] = '\0';
    if (cursor[0] && sscanf(cursor, "%lld-%32[0-9a-f]%c", &before_ms, before_id, &rest) != 2)
        return error_set(err, STATUS_INPUT,
                         "\"%.64s\" is no cursor of a list of uploads: a cursor is `next` of the page before", cursor);
    sqlite3_stmt *stmt;
    store_lock(store);
    enum status status = sql_query(&store->sql, &stmt, err,
                                   "SELECT " COLUMNS " FROM uploads"
                                   " WHERE (created_ms, id) < (?1, ?2) AND (?3 = '' OR sha256 = ?3)"
                                   " AND (?4 OR owner_id = ?5)"
                                   " ORDER BY created_ms DESC, id DESC LIMIT ?6",
                                   "ittnii", (int64_t)before_ms, before_id, sha256, (int)sees_all,
                                   sees_all ? 0 : who->user_id, (int64_t)limit + 1);
    while (sql_next(&store->sql, stmt, &status, err)) {
        if (*count == limit) { /* one row more than asked for: there is another page */
            snprintf(next_cursor, 128, "%lld-%s", (long long)rows[limit - 1].created_ms, rows[limit - 1].id);
            sqlite3_reset(stmt);
            break;
        }
        fill(&rows[(*count)++], stmt);
    }
    store_unlock(store);
    while (status != STATUS_OK && *count > 0)
        upload_row_release(&rows[--*count]);
    return status;
}

enum status store_upload_begin(struct store *store, const char *id, const char *boot, struct error *err) {
    enum status status = store_begin(store, err);
    if (status != STATUS_OK)
        return status;
    status = sql_run(&store->sql, err, "UPDATE uploads SET boot = ? WHERE id = ?", "tt", boot, id);
    return end_change(store, status, id, err);
}

enum status store_upload_advance(struct store *store, const char *id, uint64_t received, const void *hash,
                                 size_t hash_size, struct error *err) {
    enum status status = store_begin(store, err);
    if (status != STATUS_OK)
        return status;
    status = sql_run(&store->sql, err,
                     "UPDATE uploads SET updated_ms = ?1,"
                     " hash = CASE WHEN received < ?2 THEN ?3 ELSE hash END,"
                     " received = max(received, ?2) WHERE id = ?4",
                     "iibt", store_now_ms(), (int64_t)received, hash, hash_size, id);
    return end_change(store, status, id, err);
}

enum status store_upload_finish(struct store *store, const char *id, const char *scene_id, struct error *err) {
    enum status status = store_begin(store, err);
    if (status != STATUS_OK)
        return status;
    status = sql_run(&store->sql, err, "UPDATE uploads SET scene_id = ? WHERE id = ?", "tt", scene_id, id);
    return end_change(store, status, id, err);
}

enum status store_upload_set_retention(struct store *store, const char *id, const struct retention *retention,
                                       struct error *err) {
    enum status status = store_begin(store, err);
    if (status != STATUS_OK)
        return status;
    status = sql_run(&store->sql, err, "UPDATE uploads SET " RETENTION_SET " WHERE id = ?4", "nnit",
                     (int)retention->pin, (int)retention->sets_expiry, retention->expires_ms, id);
    return end_change(store, status, id, err);
}

static enum status delete_upload(struct store *store, const char *id, struct error *err) {
    enum status status = store_begin_freeing(store, err);
    if (status != STATUS_OK)
        return status;
    status = sql_run(&store->sql, err, "DELETE FROM uploads WHERE id = ?", "t", id);
    return end_change(store, status, id, err);
}

enum status store_upload_delete(struct store *store, const char *id, struct error *err) {
    enum status status;
    do
        status = delete_upload(store, id, err);
    while (status == STATUS_NO_SPACE && store_reserve_spend(store));
    return status;
}
