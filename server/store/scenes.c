/* scenes.c -- the scenes table: uploads, their check and its outcome; see store.h.
 *
 *      (upload) ──> checking ──> ready
 *                     ▲  └─────> rejected
 *                     └────────────┘ (rejected: uploaded again; either: to be read otherwise)
 *
 * A scene in `checking` that has problems is waiting for disk space.
 *
 * `receiving` exists only while the bytes arrive, and then only in memory: a row means that the
 * archive is complete and on disk. */
#include <stdio.h>
#include <string.h>

#include "common/json.h"
#include "common/mem.h"
#include "server/store/internal.h"
#include "server/store/store.h"

/* The owner whose name for the scene user ?2 sees: that user himself, else the first who shares it with him or, where
 * he sees all (?1), the first who sent it. */
#define SHOWN_OWNER                                                                                                    \
    "(SELECT user_id FROM scene_owners AS o WHERE scene_id = scenes.id AND (?1 OR user_id = ?2 OR EXISTS"              \
    " (SELECT 1 FROM jobs WHERE jobs.scene_id = o.scene_id AND owner_id = o.user_id AND shared = 1 AND kind = 0))"     \
    " ORDER BY user_id = ?2 DESC, created_ms, user_id LIMIT 1)"
#define SCENES                                                                                                         \
    "scenes LEFT JOIN scene_owners AS shown ON shown.scene_id = scenes.id AND shown.user_id = " SHOWN_OWNER            \
    " LEFT JOIN users ON users.id = shown.user_id"
/* When that owner sent it. */
#define CREATED "ifnull(shown.created_ms, scenes.created_ms)"
/* One who shared it and gave it up leaves it without a name for its readers. */
#define COLUMNS                                                                                                        \
    "scenes.id, ifnull(shown.name, substr(scenes.id, 1, 12)), state, bytes, " CREATED ", problems,"                    \
    " facts, users.name, pinned, " SCENE_EXPIRES ", disk_bytes, reading"
/* What user ?2 may read where not all (?1); see caller_access_job. */
#define IS_READABLE                                                                                                    \
    "(?1 OR EXISTS (SELECT 1 FROM scene_owners WHERE scene_id = scenes.id AND user_id = ?2)"                           \
    " OR EXISTS (SELECT 1 FROM jobs WHERE scene_id = scenes.id AND shared = 1 AND kind = 0))"
#define NOT_A_USER ((int64_t)-1) /* no row has this owner */

static void fill(struct scene_row *row, sqlite3_stmt *stmt) {
    *row = (struct scene_row){
        .name = sql_dup(stmt, 1),
        .state = (enum scene_state)sqlite3_column_int(stmt, 2),
        .bytes = (uint64_t)sqlite3_column_int64(stmt, 3),
        .created_ms = sqlite3_column_int64(stmt, 4),
        .problems = sql_dup(stmt, 5),
        .facts = sql_dup(stmt, 6),
        .owner = sql_dup(stmt, 7),
        .is_pinned = sqlite3_column_int(stmt, 8) != 0,
        .expires_ms = sqlite3_column_int64(stmt, 9),
        .disk_bytes = sqlite3_column_int64(stmt, 10),
        .reading = sql_dup(stmt, 11),
    };
    snprintf(row->id, sizeof row->id, "%s", sql_text(stmt, 0));
}

void scene_row_release(struct scene_row *row) {
    mem_free(row->name);
    mem_free(row->owner);
    mem_free(row->problems);
    mem_free(row->facts);
    mem_free(row->reading);
    *row = (struct scene_row){0};
}

static enum status not_found(const char *id, struct error *err) {
    return error_set(err, STATUS_NOT_FOUND, "there is no scene %s", id);
}

/* -1 when there is no such scene. */
static enum status state_of(struct store *store, const char *id, int64_t *state, struct error *err) {
    return sql_int(&store->sql, -1, state, err, "SELECT state FROM scenes WHERE id = ?", "t", id);
}

/* Whether its check is under way or about to be. */
static enum status is_in_check(struct store *store, const char *id, int64_t *is_so, struct error *err) {
    return sql_int(&store->sql, 0, is_so, err, "SELECT 1 FROM scenes WHERE id = ? AND state = ? AND problems = '[]'",
                   "tn", id, (int)SCENE_CHECKING);
}

enum status store_scene_add(struct store *store, const char *id, const char *name, uint64_t bytes, int64_t owner_id,
                            bool *existed, struct error *err) {
    int64_t state = -1, is_mine = 0;
    *existed = false;
    enum status status = store_begin(store, err);
    if (status != STATUS_OK)
        return status;
    status = state_of(store, id, &state, err);
    if (status == STATUS_OK)
        status = sql_int(&store->sql, 0, &is_mine, err, "SELECT 1 FROM scene_owners WHERE scene_id = ? AND user_id = ?",
                         "ti", id, owner_id);
    if (status == STATUS_OK && state < 0)
        status = sql_run(&store->sql, err,
                         "INSERT INTO scenes (id, state, bytes, created_ms)"
                         " VALUES (?, ?, ?, ?)",
                         "tnii", id, (int)SCENE_CHECKING, (int64_t)bytes, store_now_ms());
    else if (status == STATUS_OK && (state == SCENE_REJECTED || state == SCENE_CHECKING))
        status = sql_run(&store->sql, err, "UPDATE scenes SET state = ?, problems = '[]' WHERE id = ?", "nt",
                         (int)SCENE_CHECKING, id);
    if (status == STATUS_OK)
        status = sql_run(&store->sql, err,
                         "INSERT INTO scene_owners (scene_id, user_id, created_ms, name)"
                         " VALUES (?, ?, ?, ?) ON CONFLICT DO NOTHING",
                         "tiit", id, owner_id, store_now_ms(), name);
    status = store_end(store, status, 0, err);
    *existed = status == STATUS_OK && is_mine;
    return status;
}

/* The end of a check. */
static enum status conclude(struct store *store, const char *id, const char *reading, enum scene_state to,
                            const char *problems, const char *facts, struct error *err) {
    int64_t state = -1, overtaken = 0;
    enum status status = store_begin(store, err);
    if (status != STATUS_OK)
        return status;
    status = state_of(store, id, &state, err);
    if (status == STATUS_OK && state < 0)
        status = not_found(id, err);
    else if (status == STATUS_OK && state != SCENE_CHECKING)
        status = error_set(err, STATUS_CONFLICT, "scene %s is %s, not being checked", id,
                           scene_state_name((enum scene_state)state));
    if (status == STATUS_OK)
        status = store_scene_is_overtaken(store, id, reading, &overtaken, err);
    if (status == STATUS_OK && !overtaken)
        status = sql_run(&store->sql, err,
                         "UPDATE scenes SET state = ?1, problems = ?2, facts = ?3,"
                         " disk_bytes = iif(?1 = ?5, disk_bytes, -1) WHERE id = ?4",
                         "ntttn", (int)to, problems, facts, id, (int)SCENE_READY);
    return store_end(store, status, 0, err);
}

enum status store_scene_set_facts(struct store *store, const char *id, const char *reading, const char *facts,
                                  struct error *err) {
    int64_t overtaken = 0;
    enum status status = store_begin(store, err);
    if (status != STATUS_OK)
        return status;
    status = store_scene_is_overtaken(store, id, reading, &overtaken, err);
    if (status == STATUS_OK && !overtaken)
        status = sql_run(&store->sql, err, "UPDATE scenes SET facts = ? WHERE id = ? AND state = ?", "ttn", facts, id,
                         (int)SCENE_CHECKING);
    return store_end(store, status, STORE_NOTHING_CHANGED, err);
}

enum status store_scene_ready(struct store *store, const char *id, const char *reading, const char *facts,
                              struct error *err) {
    return conclude(store, id, reading, SCENE_READY, "[]", facts, err);
}

enum status store_scene_reject(struct store *store, const char *id, const char *reading, const char *problems,
                               const char *facts, struct error *err) {
    return conclude(store, id, reading, SCENE_REJECTED, problems, facts, err);
}

enum status store_scene_postpone(struct store *store, const char *id, const char *reading, const char *problems,
                                 struct error *err) {
    return conclude(store, id, reading, SCENE_CHECKING, problems, "{}", err);
}

enum status store_scene_check_again(struct store *store, struct error *err) {
    enum status status = store_begin_freeing(store, err); /* a start on a full disk needs it */
    if (status != STATUS_OK)
        return status;
    status = sql_run(&store->sql, err, "UPDATE scenes SET problems = '[]' WHERE state = ? AND problems <> '[]'", "n",
                     (int)SCENE_CHECKING);
    return store_end(store, status, STORE_NOTHING_CHANGED, err);
}

enum status store_scene_get(struct store *store, const char *id, struct scene_row *row, struct error *err) {
    sqlite3_stmt *stmt;
    bool found = false;
    *row = (struct scene_row){0};
    store_lock(store);
    enum status status = sql_first(&store->sql, &stmt, &found, err,
                                   "SELECT " COLUMNS " FROM " SCENES " WHERE scenes.id = ?3", "nit", 1, NOT_A_USER, id);
    if (found) {
        fill(row, stmt);
        sqlite3_reset(stmt);
    }
    store_unlock(store);
    return status == STATUS_OK && !found ? not_found(id, err) : status;
}

static bool sees_all(const struct caller *who) { return !who || who->role == ROLE_ADMIN; }

static int64_t user_of(const struct caller *who) { return who ? who->user_id : NOT_A_USER; }

enum status store_scene_find(struct store *store, const struct caller *who, const char *prefix, struct scene_row *row,
                             struct error *err) {
    *row = (struct scene_row){0};
    size_t length = strlen(prefix);
    if (length < 4 || length >= SCENE_ID_SIZE || strspn(prefix, "0123456789abcdef") != length)
        return not_found(prefix, err);
    sqlite3_stmt *stmt;
    bool found = false, another = false;
    store_lock(store);
    /* 'g' follows every hex digit. */
    enum status status = sql_first(&store->sql, &stmt, &found, err,
                                   "SELECT " COLUMNS " FROM " SCENES
                                   " WHERE scenes.id >= ?3 AND scenes.id < ?3 || 'g' AND " IS_READABLE " LIMIT 2",
                                   "nit", (int)sees_all(who), user_of(who), prefix);
    if (found) {
        fill(row, stmt);
        status = sql_step(&store->sql, stmt, &another, err);
        sqlite3_reset(stmt);
    }
    store_unlock(store);
    if (status == STATUS_OK && !found)
        return not_found(prefix, err);
    if (status == STATUS_OK && another)
        status = error_set(err, STATUS_CONFLICT, "more than one scene's id begins with %s", prefix);
    if (status != STATUS_OK)
        scene_row_release(row);
    return status;
}

enum status store_scene_list(struct store *store, const struct caller *who, const char *cursor, size_t limit,
                             struct scene_row *rows, size_t *count, char next_cursor[128], struct error *err) {
    long long before_ms = INT64_MAX;
    char before_id[SCENE_ID_SIZE] = "";
    char rest;
    *count = 0;
    next_cursor[0] = '\0';
    if (cursor[0] && sscanf(cursor, "%lld-%64[0-9a-f]%c", &before_ms, before_id, &rest) != 2)
        return error_set(err, STATUS_INPUT,
                         "\"%.64s\" is no cursor of a list of scenes: a cursor is `next` of the page before", cursor);
    sqlite3_stmt *stmt;
    store_lock(store);
    enum status status =
        sql_query(&store->sql, &stmt, err,
                  "SELECT " COLUMNS " FROM " SCENES " WHERE (" CREATED ", scenes.id) < (?3, ?4) AND " IS_READABLE
                  " ORDER BY " CREATED " DESC, scenes.id DESC LIMIT ?5",
                  "niiti", (int)sees_all(who), user_of(who), (int64_t)before_ms, before_id, (int64_t)limit + 1);
    while (sql_next(&store->sql, stmt, &status, err)) {
        if (*count == limit) { /* one more than asked for: there is another page */
            if (limit > 0)
                snprintf(next_cursor, 128, "%lld-%s", (long long)rows[limit - 1].created_ms, rows[limit - 1].id);
            sqlite3_reset(stmt);
            break;
        }
        fill(&rows[(*count)++], stmt);
    }
    store_unlock(store);
    while (status != STATUS_OK && *count > 0)
        scene_row_release(&rows[--*count]);
    return status;
}

/* Whether the scene is somebody's besides owner_id's (-1: that does not matter). */
static enum status is_others_too(struct store *store, const char *id, int64_t owner_id, int64_t *is_so,
                                 struct error *err) {
    *is_so = 0;
    return owner_id < 0
               ? STATUS_OK
               : sql_int(&store->sql, 0, is_so, err,
                         "SELECT 1 FROM scene_owners WHERE scene_id = ? AND user_id <> ? LIMIT 1", "ti", id, owner_id);
}

enum status store_scene_patch(struct store *store, const struct caller *who, const char *id,
                              const struct scene_patch *patch, struct error *err) {
    const struct retention *retention = &patch->retention;
    int64_t others = 0;
    enum status status = store_begin(store, err);
    if (status != STATUS_OK)
        return status;
    if (retention->pin == KEEP_PIN_OFF || retention->sets_expiry)
        status = is_others_too(store, id, sees_all(who) ? NOT_A_USER : who->user_id, &others, err);
    if (others) {
        error_set(err, STATUS_CONFLICT, "others own scene %s too, so you cannot set when it is removed", id);
        status = error_hint(err, "You can pin it; DELETE ends only your ownership.");
    }
    if (status == STATUS_OK)
        status = sql_run(&store->sql, err, "UPDATE scenes SET " RETENTION_SET " WHERE id = ?4", "nnit",
                         (int)retention->pin, (int)retention->sets_expiry, retention->expires_ms, id);
    if (status == STATUS_OK && sql_changes(&store->sql) == 0)
        status = not_found(id, err);
    if (status == STATUS_OK && patch->reading)
        status = store_scene_set_reading(store, id, sees_all(who) ? NOT_A_USER : who->user_id, patch->reading, err);
    if (status == STATUS_OK && patch->name)
        status = sql_run(&store->sql, err,
                         "UPDATE scene_owners SET name = ?3 FROM scenes WHERE scenes.id = ?4 AND scene_id = ?4"
                         " AND user_id = " SHOWN_OWNER,
                         "nitt", (int)sees_all(who), user_of(who), patch->name, id);
    return store_end(store, status, 0, err);
}

static enum status delete_scene(struct store *store, const char *id, int64_t owner_id, bool dry_run, bool *is_gone,
                                struct error *err) {
    int64_t state = -1, others = 0, job = 0, in_check = 0;
    *is_gone = false;
    enum status status = store_begin_freeing(store, err);
    if (status != STATUS_OK)
        return status;
    status = state_of(store, id, &state, err);
    if (status == STATUS_OK && state < 0)
        status = not_found(id, err);
    if (status == STATUS_OK)
        status = is_others_too(store, id, owner_id, &others, err);
    if (status == STATUS_OK)
        status = is_in_check(store, id, &in_check, err);
    if (status == STATUS_OK && in_check && !others)
        status = error_set(err, STATUS_CONFLICT, "scene %s is being checked", id);
    if (status == STATUS_OK)
        status = sql_int(&store->sql, 0, &job, err,
                         "SELECT id FROM jobs WHERE scene_id = ? AND state <= 2 AND kind <> 1"
                         " AND (? = 0 OR owner_id = ?) LIMIT 1",
                         "tii", id, others, owner_id);
    if (status == STATUS_OK && job > 0) {
        error_set(err, STATUS_CONFLICT, "a job still uses scene %s", id);
        status = error_hint(err, "Cancel the job or wait for its end.");
    }
    if (status == STATUS_OK && !dry_run)
        status = others ? sql_run(&store->sql, err, "DELETE FROM scene_owners WHERE scene_id = ? AND user_id = ?", "ti",
                                  id, owner_id)
                        : sql_run(&store->sql, err, "DELETE FROM scenes WHERE id = ?", "t", id);
    status = store_end(store, status, 0, err);
    *is_gone = status == STATUS_OK && !others;
    return status;
}

enum status store_scene_delete(struct store *store, const char *id, int64_t owner_id, bool dry_run, bool *is_gone,
                               struct error *err) {
    enum status status;
    do
        status = delete_scene(store, id, owner_id, dry_run, is_gone, err);
    while (status == STATUS_NO_SPACE && store_reserve_spend(store));
    return status;
}

enum status store_scene_unchecked(struct store *store, const struct unchecked *skip, size_t skip_count, size_t limit,
                                  struct unchecked *list, size_t *count, struct error *err) {
    sqlite3_stmt *stmt;
    cJSON *ids = cJSON_CreateArray();
    for (size_t i = 0; i < skip_count; i++)
        cJSON_AddItemToArray(ids, cJSON_CreateString(skip[i].id));
    char *skipped = json_text(ids);
    *count = 0;
    store_lock(store);
    /* The other columns are those of the row that has the minimum: sqlite.org/lang_select.html, 3.2 */
    enum status status =
        sql_query(&store->sql, &stmt, err,
                  "SELECT id, owner, min(created_ms) AS oldest FROM (SELECT id, created_ms,"
                  " ifnull((SELECT user_id FROM scene_owners WHERE scene_id = scenes.id"
                  "  ORDER BY created_ms, user_id LIMIT 1), 0) AS owner FROM scenes"
                  "  WHERE state = ? AND problems = '[]' AND id NOT IN (SELECT value FROM json_each(?)))"
                  " GROUP BY owner ORDER BY oldest, id LIMIT ?",
                  "nti", (int)SCENE_CHECKING, skipped, (int64_t)limit);
    while (sql_next(&store->sql, stmt, &status, err)) {
        struct unchecked *u = &list[(*count)++];
        snprintf(u->id, sizeof u->id, "%s", sql_text(stmt, 0));
        u->owner_id = sqlite3_column_int64(stmt, 1);
    }
    store_unlock(store);
    mem_free(skipped);
    cJSON_Delete(ids);
    return status;
}
