/* scene_reading.c -- how a scene is to be read: when that may change, and what a check then counts for; see store.h.
 *
 * 1. A job reads a scene in one way from its first attempt to its end: what has begun keeps the reading from changing.
 * 2. A check counts for the reading that it had: one that was overtaken is done again. */
#include "server/store/internal.h"
#include "server/store/store.h"

enum status store_scene_is_overtaken(struct store *store, const char *id, const char *reading, int64_t *is_so,
                                     struct error *err) {
    *is_so = 0;
    return reading ? sql_int(&store->sql, 0, is_so, err, "SELECT 1 FROM scenes WHERE id = ? AND reading <> ?", "tt", id,
                             reading)
                   : STATUS_OK;
}

/* Whether a job keeps the scene from being read otherwise: one that has begun, whose checkpoint and files would not go
 * with it, or one of others (other_than; -1: that does not matter) that waits. */
static enum status check_reading(struct store *store, const char *id, int64_t other_than, struct error *err) {
    int64_t begun = 0, waits = 0;
    enum status status =
        sql_int(&store->sql, 0, &begun, err,
                "SELECT 1 FROM jobs WHERE scene_id = ? AND state <= 2 AND attempt > 0 AND kind <> 1 LIMIT 1", "t", id);
    if (status == STATUS_OK && !begun && other_than >= 0)
        status = sql_int(&store->sql, 0, &waits, err,
                         "SELECT 1 FROM jobs WHERE scene_id = ? AND state <= 2 AND owner_id <> ? AND kind <> 1 LIMIT 1",
                         "ti", id, other_than);
    if (begun) {
        error_set(err, STATUS_CONFLICT, "a job has begun with scene %s as it is read now", id);
        status = error_hint(err, "Cancel the job or wait for its end.");
    } else if (waits) {
        error_set(err, STATUS_CONFLICT, "a job of another user waits for scene %s as it is read now", id);
        status = error_hint(err, "Wait for its end, or send an archive of your own: the same files packed otherwise.");
    }
    return status;
}

enum status store_scene_set_reading(struct store *store, const char *id, int64_t owner_id, const char *reading,
                                    struct error *err) {
    int64_t is_so = 0;
    enum status status = sql_int(&store->sql, 0, &is_so, err,
                                 "SELECT 1 FROM scenes WHERE id = ? AND state = ? AND problems = '[]' AND reading = ?",
                                 "tnt", id, (int)SCENE_CHECKING, reading);
    if (status != STATUS_OK || is_so)
        return status;
    status = check_reading(store, id, owner_id, err);
    if (status == STATUS_OK)
        status = sql_run(&store->sql, err,
                         "UPDATE scenes SET reading = ?, state = ?, problems = '[]', facts = '{}' WHERE id = ?", "tnt",
                         reading, (int)SCENE_CHECKING, id);
    return status;
}

enum status store_scene_give_reading(struct store *store, const struct caller *who, const char *id, const char *reading,
                                     struct error *err) {
    int64_t has_it = 0, is_admin = who->role == ROLE_ADMIN;
    enum status status = store_begin(store, err);
    if (status != STATUS_OK)
        return status;
    status =
        sql_int(&store->sql, 0, &has_it, err, "SELECT 1 FROM scenes WHERE id = ? AND reading = ?", "tt", id, reading);
    if (status == STATUS_OK && !has_it)
        status = store_scene_set_reading(store, id, is_admin ? -1 : who->user_id, reading, err);
    return store_end(store, status, has_it ? STORE_NOTHING_CHANGED : 0, err);
}
