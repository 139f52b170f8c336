/* share.c -- what users keep on the disk, and their limit; see store.h. The size of each folder is stored when it
 * changes, so a request costs one sum over the user's rows. While a size is unknown, and while a job runs, the known
 * files count. */
#include <stdio.h>

#include "server/store/internal.h"
#include "server/store/store.h"

#define MIB 1048576.0 /* bytes */

/* The sum of what a user keeps (an SQL expression of his id), without scene ?1 and job ?2. State 1: running. */
#define KEPT_BY(user)                                                                                                  \
    "((SELECT ifnull(sum(max(scenes.bytes, scenes.disk_bytes)), 0) FROM scenes"                                        \
    "    JOIN scene_owners ON scene_id = scenes.id WHERE scene_owners.user_id = " user " AND scenes.id <> ?1)"         \
    " + (SELECT ifnull(sum(iif(state <> 1 AND disk_bytes >= 0, disk_bytes, max(disk_bytes,"                            \
    "     (SELECT ifnull(sum(outputs.bytes), 0) FROM outputs WHERE job_id = jobs.id)))), 0)"                           \
    "    FROM jobs WHERE owner_id = " user " AND id <> ?2)"                                                            \
    " + (SELECT ifnull(sum(length), 0) FROM uploads WHERE owner_id = " user " AND scene_id = ''))"

enum status store_user_bytes(struct store *store, int64_t user_id, const char *but_scene, int64_t but_job,
                             uint64_t *bytes, struct error *err) {
    int64_t sum = 0;
    store_lock(store);
    enum status status = sql_int(&store->sql, 0, &sum, err, "SELECT " KEPT_BY("?3"), "tii", but_scene ? but_scene : "",
                                 but_job, user_id);
    store_unlock(store);
    *bytes = (uint64_t)sum;
    return status;
}

enum status store_user_pledged(struct store *store, int64_t user_id, int64_t since_ms, uint64_t *bytes,
                               struct error *err) {
    int64_t sum = 0;
    store_lock(store);
    enum status status =
        sql_int(&store->sql, 0, &sum, err,
                "SELECT ifnull(sum(length - received), 0) FROM uploads WHERE owner_id = ? AND scene_id = ''"
                " AND updated_ms >= ?",
                "ii", user_id, since_ms);
    store_unlock(store);
    *bytes = (uint64_t)sum;
    return status;
}

enum status store_user_uploads(struct store *store, int64_t user_id, size_t *count, struct error *err) {
    int64_t found = 0;
    store_lock(store);
    enum status status = sql_int(&store->sql, 0, &found, err,
                                 "SELECT count(*) FROM uploads WHERE owner_id = ? AND scene_id = ''", "i", user_id);
    store_unlock(store);
    *count = (size_t)found;
    return status;
}

enum status store_user_checks(struct store *store, int64_t user_id, size_t *count, struct error *err) {
    int64_t found = 0;
    store_lock(store);
    enum status status = sql_int(&store->sql, 0, &found, err,
                                 "SELECT count(*) FROM scenes JOIN scene_owners ON scene_id = scenes.id"
                                 " WHERE user_id = ? AND state = ?",
                                 "in", user_id, (int)SCENE_CHECKING);
    store_unlock(store);
    *count = (size_t)found;
    return status;
}

/* STATUS_LIMIT where `kept` and `more` together pass the limit. */
static enum status compare(uint64_t kept, uint64_t more, uint64_t limit, struct error *err) {
    if (kept < limit && more <= limit - kept)
        return STATUS_OK;
    if (more > 0)
        error_set(err, STATUS_LIMIT,
                  "your scenes and jobs take %.1f of the %.1f MiB that a user may keep, and %.1f MiB more are needed",
                  (double)kept / MIB, (double)limit / MIB, (double)more / MIB);
    else
        error_set(err, STATUS_LIMIT, "your scenes and jobs take %.1f of the %.1f MiB that a user may keep",
                  (double)kept / MIB, (double)limit / MIB);
    return error_hint(err,
                      "delete jobs or scenes that you do not need; an administrator can raise the option user_max_mib");
}

enum status store_share_check(struct store *store, const struct share *share, uint64_t more, struct error *err) {
    uint64_t kept;
    if (share->limit_bytes == 0 || share->user_id == 0)
        return STATUS_OK;
    enum status status = store_user_bytes(store, share->user_id, share->but_scene, share->but_job, &kept, err);
    return status == STATUS_OK ? compare(kept, more, share->limit_bytes, err) : status;
}

enum status store_share_check_scene(struct store *store, const char *id, uint64_t bytes, uint64_t limit_bytes,
                                    struct error *err) {
    int64_t least = 0;
    if (limit_bytes == 0)
        return STATUS_OK;
    store_lock(store);
    enum status status = sql_int(&store->sql, 0, &least, err,
                                 "SELECT ifnull(min(iif(o.user_id = 0, -1, " KEPT_BY(
                                     "o.user_id") ")), -1)"
                                                  " FROM scene_owners AS o WHERE o.scene_id = ?1",
                                 "ti", id, (int64_t)0);
    store_unlock(store);
    return status == STATUS_OK && least >= 0 ? compare((uint64_t)least, bytes, limit_bytes, err) : status;
}

/* Part of the end of an attempt. */
static enum status enter_all(struct store *store, const struct disk_use *list, size_t count, struct error *err) {
    enum status status = store_begin_freeing(store, err);
    if (status != STATUS_OK)
        return status;
    for (size_t i = 0; i < count && status == STATUS_OK; i++)
        status =
            list[i].job_id
                ? sql_run(&store->sql, err,
                          "UPDATE jobs SET disk_bytes = ?1, revision = revision + 1 WHERE id = ?2 AND disk_bytes <> ?1",
                          "ii", list[i].bytes, list[i].job_id)
                : sql_run(&store->sql, err, "UPDATE scenes SET disk_bytes = ? WHERE id = ?", "it", list[i].bytes,
                          list[i].scene_id);
    return store_end(store, status, STORE_NOTHING_CHANGED, err);
}

enum status store_disk_enter(struct store *store, const struct disk_use *list, size_t count, struct error *err) {
    enum status status;
    do
        status = enter_all(store, list, count, err);
    while (status == STATUS_NO_SPACE && store_reserve_spend(store));
    return status;
}

enum status store_disk_unknown(struct store *store, size_t skip, size_t limit, struct disk_use *list, size_t *count,
                               struct error *err) {
    sqlite3_stmt *stmt;
    *count = 0;
    store_lock(store);
    enum status status = sql_query(&store->sql, &stmt, err,
                                   "SELECT id AS job, '' AS scene FROM jobs WHERE disk_bytes < 0"
                                   " UNION ALL SELECT 0, id FROM scenes WHERE disk_bytes < 0 AND state = ?"
                                   " ORDER BY job, scene LIMIT ? OFFSET ?",
                                   "nii", (int)SCENE_READY, (int64_t)limit, (int64_t)skip);
    while (sql_next(&store->sql, stmt, &status, err)) {
        struct disk_use *use = &list[(*count)++];
        *use = (struct disk_use){.job_id = sqlite3_column_int64(stmt, 0), .bytes = -1};
        snprintf(use->scene_id, sizeof use->scene_id, "%s", sql_text(stmt, 1));
    }
    store_unlock(store);
    return status;
}
