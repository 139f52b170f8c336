/* retention.c -- see retention.h. The rules are SQL expressions in internal.h, so that a listing
 * shows what the collector will do. */
#include "server/store/retention.h"

#include <stdio.h>
#include <stdlib.h>

#include "common/mem.h"
#include "server/store/internal.h"

enum status store_retention_set_periods(struct store *store, int64_t scene_ms, int64_t job_ms, int64_t upload_ms,
                                        struct error *err) {
    enum status status =
        store_begin_freeing(store, err); /* a daemon that cannot do this never starts to free anything */
    if (status != STATUS_OK)
        return status;
    status = sql_run(&store->sql, err, "UPDATE retention SET scene_ms = ?, job_ms = ?, upload_ms = ?", "iii", scene_ms,
                     job_ms, upload_ms);
    return store_end(store, status, STORE_NOTHING_CHANGED, err);
}

enum status store_retention_set_empty_upload(struct store *store, int64_t upload_ms, struct error *err) {
    enum status status = store_begin_freeing(store, err);
    if (status != STATUS_OK)
        return status;
    status = sql_run(&store->sql, err, "UPDATE retention SET empty_upload_ms = ?", "i", upload_ms);
    return store_end(store, status, STORE_NOTHING_CHANGED, err);
}

enum status store_expired_list(struct store *store, int64_t now_ms, size_t limit, struct expired **list, size_t *count,
                               struct error *err) {
    sqlite3_stmt *stmt;
    *list = mem_calloc(limit, sizeof **list);
    *count = 0;
    store_lock(store);
    enum status status =
        sql_query(&store->sql, &stmt, err,
                  "SELECT * FROM (SELECT 0 AS kind, id, name, " UPLOAD_EXPIRES " AS expires FROM uploads"
                  " UNION ALL SELECT 1, id, name, " JOB_EXPIRES " FROM jobs"
                  " UNION ALL SELECT 2, id, ifnull((SELECT name FROM scene_owners WHERE scene_id = scenes.id"
                  "  ORDER BY created_ms, user_id LIMIT 1), ''), " SCENE_EXPIRES " FROM scenes)"
                  " WHERE expires BETWEEN 1 AND ? ORDER BY kind, expires LIMIT ?",
                  "ii", now_ms, (int64_t)limit);
    while (sql_next(&store->sql, stmt, &status, err)) {
        struct expired *e = &(*list)[(*count)++];
        e->kind = (enum expired_kind)sqlite3_column_int(stmt, 0);
        snprintf(e->id, sizeof e->id, "%s", sql_text(stmt, 1));
        e->name = sql_dup(stmt, 2);
        e->expires_ms = sqlite3_column_int64(stmt, 3);
    }
    store_unlock(store);
    return status;
}

static enum status delete_expired(struct store *store, const struct expired *what, int64_t now_ms, struct error *err) {
    enum status status = store_begin_freeing(store, err);
    int64_t changed = what->kind == EXPIRED_JOB     ? (int64_t)strtoll(what->id, NULL, 10)
                      : what->kind == EXPIRED_SCENE ? 0
                                                    : STORE_NOTHING_CHANGED;
    if (status != STATUS_OK)
        return status;
    if (what->kind == EXPIRED_UPLOAD)
        status = sql_run(&store->sql, err, "DELETE FROM uploads WHERE id = ? AND " UPLOAD_EXPIRES " BETWEEN 1 AND ?",
                         "ti", what->id, now_ms);
    else if (what->kind == EXPIRED_JOB)
        status = sql_run(&store->sql, err, "DELETE FROM jobs WHERE id = ? AND " JOB_EXPIRES " BETWEEN 1 AND ?", "ii",
                         changed, now_ms);
    else
        status = sql_run(&store->sql, err, "DELETE FROM scenes WHERE id = ? AND " SCENE_EXPIRES " BETWEEN 1 AND ?",
                         "ti", what->id, now_ms);
    if (status == STATUS_OK && sql_changes(&store->sql) == 0)
        status = error_set(err, STATUS_CONFLICT, "%s does not expire any more", what->id);
    return store_end(store, status, changed, err);
}

enum status store_expired_delete(struct store *store, const struct expired *what, int64_t now_ms, struct error *err) {
    enum status status;
    do
        status = delete_expired(store, what, now_ms, err);
    while (status == STATUS_NO_SPACE && store_reserve_spend(store));
    return status;
}
