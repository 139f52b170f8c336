/* jobs.c -- the jobs table: adds, reads, edits, chooses; see store.h. Changes of state are in transitions.c. */
#include <limits.h>
#include <stdio.h>
#include <string.h>

#include "common/mem.h"
#include "server/store/internal.h"
#include "server/store/job_files.h"
#include "server/store/store.h"

#define COLUMNS                                                                                                        \
    "id, revision, scene_id, name, labels, settings, priority, state, wanted, attempt,"                                \
    " attempts_left, created_ms, started_ms, finished_ms, stage, progress, eta_sec, reason,"                           \
    " hint, owner_id, (SELECT users.name FROM users WHERE users.id = owner_id), shared, turn,"                         \
    " restart_from, memory_step, pinned, " JOB_EXPIRES ","                                                             \
    " (SELECT url FROM webhooks WHERE job_id = jobs.id), disk_bytes,"                                                  \
    " (SELECT json_object('state', CASE WHEN w.waiting > 0 THEN 'pending' WHEN result = '' THEN 'idle'"                \
    "  WHEN result = 'delivered' THEN result ELSE 'failed' END, 'pending', w.waiting, 'attempts', attempts,"           \
    "  'last_status', nullif(status, 0), 'last_error', nullif(error, ''), 'next_ms', w.next_ms, 'at_ms', at_ms)"       \
    "  FROM webhooks, (SELECT count(*) AS waiting, min(next_ms) AS next_ms FROM outbox WHERE job_id = jobs.id) AS w"   \
    "  WHERE webhooks.job_id = jobs.id),"                                                                              \
    " kind, source_id, cost,"                                                                                          \
    " (SELECT json_group_array(json_object('name', job_files.name, 'bytes', iif(bytes < 0, NULL, bytes),"              \
    "  'sha256', nullif(sha256, ''))) FROM job_files WHERE job_id = jobs.id),"                                         \
    " (SELECT count(*) FROM parts WHERE job_id = jobs.id),"                                                            \
    " (SELECT count(*) FROM parts WHERE job_id = jobs.id AND parts.state = 1)"

static void fill(struct job *job, sqlite3_stmt *stmt) {
    *job = (struct job){
        .id = sqlite3_column_int64(stmt, 0),
        .revision = sqlite3_column_int64(stmt, 1),
        .name = sql_dup(stmt, 3),
        .labels = sql_dup(stmt, 4),
        .settings = sql_dup(stmt, 5),
        .priority = sqlite3_column_int(stmt, 6),
        .state = (enum job_state)sqlite3_column_int(stmt, 7),
        .wanted = (enum job_wanted)sqlite3_column_int(stmt, 8),
        .attempt = sqlite3_column_int(stmt, 9),
        .attempts_left = sqlite3_column_int(stmt, 10),
        .created_ms = sqlite3_column_int64(stmt, 11),
        .started_ms = sqlite3_column_int64(stmt, 12),
        .finished_ms = sqlite3_column_int64(stmt, 13),
        .stage = sql_dup(stmt, 14),
        .progress = sqlite3_column_double(stmt, 15),
        .eta_sec = sqlite3_column_double(stmt, 16),
        .reason = sql_dup(stmt, 17),
        .hint = sql_dup(stmt, 18),
        .owner_id = sqlite3_column_int64(stmt, 19),
        .owner = sql_dup(stmt, 20),
        .is_shared = sqlite3_column_int(stmt, 21) != 0,
        .turn = sqlite3_column_int64(stmt, 22),
        .restart_from = sql_dup(stmt, 23),
        .memory_step = sqlite3_column_int(stmt, 24),
        .is_pinned = sqlite3_column_int(stmt, 25) != 0,
        .expires_ms = sqlite3_column_int64(stmt, 26),
        .webhook = sql_dup(stmt, 27),
        .disk_bytes = sqlite3_column_int64(stmt, 28),
        .delivery = sql_dup(stmt, 29),
        .kind = (enum job_kind)sqlite3_column_int(stmt, 30),
        .source_id = sqlite3_column_int64(stmt, 31),
        .cost = sqlite3_column_double(stmt, 32),
        .files = sql_dup(stmt, 33),
        .part_count = sqlite3_column_int(stmt, 34),
        .parts_done = sqlite3_column_int(stmt, 35),
    };
    strncpy(job->scene_id, sql_text(stmt, 2), sizeof job->scene_id - 1);
}

static enum status not_found(int64_t id, struct error *err) {
    return error_set(err, STATUS_NOT_FOUND, "there is no job %lld", (long long)id);
}

/* Keys are per owner: the stored key begins with the owner's number. */
static char *stored_key(const struct job_new *job) {
    return !job->idempotency_key ? NULL
           : job->owner_id == 0  ? mem_strdup(job->idempotency_key)
                                 : mem_printf("%lld/%s", (long long)job->owner_id, job->idempotency_key);
}

/* The job that a known idempotency key made; *id stays 0 when the key is new. */
static enum status find_replay(struct store *store, const struct job_new *job, const char *key, int64_t *id,
                               struct error *err) {
    sqlite3_stmt *stmt;
    bool found = false, same = false;
    enum status status = sql_first(&store->sql, &stmt, &found, err,
                                   "SELECT id, request_sha256 FROM jobs WHERE idempotency_key = ?", "t", key);
    if (found) {
        *id = sqlite3_column_int64(stmt, 0);
        same = strcmp(sql_text(stmt, 1), job->request_sha256 ? job->request_sha256 : "") == 0;
        sqlite3_reset(stmt);
    }
    if (status != STATUS_OK || !found || same)
        return status;
    error_set(err, STATUS_CONFLICT, "the idempotency key made job %lld from another request", (long long)*id);
    return error_hint(err, "Use a new key for a new request.");
}

/* Whether the owner may keep one more job. Ended jobs are not removed to make room: their results may be all that is
 * left of days of work. */
static enum status check_kept(struct store *store, const struct job_new *job, struct error *err) {
    int64_t kept = 0, oldest = 0;
    if (job->user_max_jobs == 0 || job->owner_id == 0)
        return STATUS_OK;
    enum status status =
        sql_int(&store->sql, 0, &kept, err, "SELECT count(*) FROM jobs WHERE owner_id = ?", "i", job->owner_id);
    if (status != STATUS_OK || (uint64_t)kept < job->user_max_jobs)
        return status;
    status = sql_int(&store->sql, 0, &oldest, err,
                     "SELECT min(id) FROM jobs WHERE owner_id = ? AND state >= ? AND pinned = 0", "in", job->owner_id,
                     (int)JOB_SUCCEEDED);
    if (status != STATUS_OK)
        return status;
    error_set(err, STATUS_NO_SPACE, "you keep %lld jobs, and a user may keep %zu", (long long)kept, job->user_max_jobs);
    char ended[64] = "";
    if (oldest)
        snprintf(ended, sizeof ended, "; the oldest that has ended is %lld", (long long)oldest);
    return error_hint(err, "delete jobs that you do not need%s; an administrator can raise the option user_max_jobs",
                      ended);
}

/* Whether the scene may have one more job. */
static enum status check_scene(struct store *store, const struct job_new *job, struct error *err) {
    int64_t state;
    enum status status =
        sql_int(&store->sql, -1, &state, err, "SELECT state FROM scenes WHERE id = ?", "t", job->scene_id);
    if (status != STATUS_OK)
        return status;
    if (state < 0)
        return error_set(err, STATUS_NOT_FOUND, "there is no scene %s", job->scene_id);
    if (state == SCENE_REJECTED) {
        error_set(err, STATUS_CONFLICT, "scene %s was rejected", job->scene_id);
        return error_hint(err, "`unbake scenes show %.12s`, or GET /v1/scenes/%.12s, lists its problems.",
                          job->scene_id, job->scene_id);
    }
    return STATUS_OK;
}

/* Whether one more job may be queued for what it reads. */
static enum status check_new(struct store *store, const struct job_new *job, size_t queue_limit, struct error *err) {
    enum status status = job->kind == JOB_RENDER ? STATUS_OK : check_scene(store, job, err);
    if (status == STATUS_OK && job->kind != JOB_RECONSTRUCT)
        status = source_check_readable(store, job->source_id, err);
    if (status == STATUS_OK)
        status = check_kept(store, job, err);
    const struct count_limits limits = {queue_limit, job->user_queue_limit};
    return status == STATUS_OK ? store_queue_check(store, job->owner_id, &limits, err) : status;
}

/* Inside a transaction: adds the rows of a job that waits in the queue or, paused, for its files. */
static enum status insert(struct store *store, const struct job_new *job, const char *key, int64_t *id,
                          struct error *err) {
    bool waits = job->file_count > 0;
    enum status status = sql_run(
        &store->sql, err,
        "INSERT INTO jobs (scene_id, name, labels, settings, priority, attempts_left, created_ms, idempotency_key,"
        " request_sha256, owner_id, shared, kind, source_id, cost, state, reason, hint, disk_bytes, turn, executor)"
        " VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13, ?14, ?15, ?16, ?17, 0,"
        " (SELECT ifnull(max(turn), 0) + 1 FROM jobs), iif(json_valid(?4), ifnull(json_extract(?4, '$.executor'), ''), ''))",
        "ttttnnittinnidntt", job->scene_id, job->name, job->labels, job->settings, job->priority, job->max_attempts,
        store_now_ms(), key, job->request_sha256, job->owner_id, (int)job->is_shared, (int)job->kind, job->source_id,
        job->cost, (int)(waits ? JOB_PAUSED : JOB_QUEUED), waits ? JOB_FILES_REASON : "", waits ? JOB_FILES_HINT : "");
    *id = sqlite3_last_insert_rowid(store->sql.db);
    for (size_t i = 0; i < job->file_count && status == STATUS_OK; i++)
        status = sql_run(&store->sql, err, "INSERT OR IGNORE INTO job_files (job_id, name) VALUES (?, ?)", "it", *id,
                         job->file[i]);
    if (status == STATUS_OK)
        status = store_event_append(
            store, *id, 0, "state",
            waits ? "{\"state\":\"paused\",\"reason\":\"" JOB_FILES_REASON "\"}" : "{\"state\":\"queued\"}", err);
    if (status == STATUS_OK && job->webhook_url)
        status = store_webhook_set(store, *id, job->webhook_url, job->webhook_secret, err);
    return status;
}

enum status store_job_add(struct store *store, const struct job_new *job, size_t queue_limit, int64_t *id,
                          bool *replayed, struct error *err) {
    *id = 0;
    *replayed = false;
    enum status status = store_begin(store, err);
    if (status != STATUS_OK)
        return status;
    char *key = stored_key(job);
    if (key)
        status = find_replay(store, job, key, id, err);
    if (status == STATUS_OK && *id == 0)
        status = check_new(store, job, queue_limit, err);
    if (status == STATUS_OK && *id > 0) {
        *replayed = true;
        mem_free(key);
        return store_end(store, status, STORE_NOTHING_CHANGED, err);
    }
    if (status == STATUS_OK)
        status = insert(store, job, key, id, err);
    mem_free(key);
    return store_end(store, status, *id, err);
}

enum status store_job_get(struct store *store, int64_t id, struct job *job, struct error *err) {
    sqlite3_stmt *stmt;
    bool found = false;
    *job = (struct job){.eta_sec = -1.0};
    store_lock(store);
    enum status status =
        sql_first(&store->sql, &stmt, &found, err, "SELECT " COLUMNS " FROM jobs WHERE id = ?", "i", id);
    if (found) {
        fill(job, stmt);
        sqlite3_reset(stmt);
    }
    store_unlock(store);
    return status == STATUS_OK && !found ? not_found(id, err) : status;
}

/* The jobs of a filter. Three statements, since SQLite chooses an index for each text, not for each value. */
static enum status query_list(struct store *store, const struct caller *who, const struct job_filter *f, int64_t before,
                              size_t limit, sqlite3_stmt **stmt, struct error *err) {
    int sees_all = !who || who->role == ROLE_ADMIN;
    int64_t user = sees_all ? 0 : who->user_id;
    if (f->label)
        return sql_query(&store->sql, stmt, err,
                         "SELECT " COLUMNS " FROM jobs WHERE id IN (SELECT job_id FROM job_labels WHERE label = ?1"
                         " AND (?2 IS NULL OR value = ?2)) AND id < ? AND ? IN (-1, state) AND ? IN (-1, kind)"
                         " AND ? IN (0, source_id)"
                         " AND (? OR owner_id = ? OR shared) ORDER BY id DESC LIMIT ?",
                         "ttinninii", f->label, f->value, before, f->state, f->kind, f->source_id, sees_all, user,
                         (int64_t)limit);
    if (f->state < 0)
        return sql_query(&store->sql, stmt, err,
                         "SELECT " COLUMNS " FROM jobs WHERE id < ? AND ? IN (-1, kind)"
                         " AND ? IN (0, source_id)"
                         " AND (? OR owner_id = ? OR shared) ORDER BY id DESC LIMIT ?",
                         "ininii", before, f->kind, f->source_id, sees_all, user, (int64_t)limit);
    return sql_query(&store->sql, stmt, err,
                     "SELECT " COLUMNS " FROM jobs WHERE id < ? AND state = ? AND ? IN (-1, kind)"
                     " AND ? IN (0, source_id)"
                     " AND (? OR owner_id = ? OR shared) ORDER BY id DESC LIMIT ?",
                     "inninii", before, f->state, f->kind, f->source_id, sees_all, user, (int64_t)limit);
}

enum status store_job_list(struct store *store, const struct caller *who, const struct job_filter *filter,
                           int64_t before_id, size_t limit, struct job *jobs, size_t *count, struct error *err) {
    const struct job_filter all = {.state = -1, .kind = -1};
    sqlite3_stmt *stmt;
    *count = 0;
    store_lock(store);
    enum status status =
        query_list(store, who, filter ? filter : &all, before_id > 0 ? before_id : INT64_MAX, limit, &stmt, err);
    while (sql_next(&store->sql, stmt, &status, err))
        fill(&jobs[(*count)++], stmt);
    store_unlock(store);
    while (status != STATUS_OK && *count > 0)
        job_release(&jobs[--*count]);
    return status;
}

/* Places job `id` before `next`, of the same owner; all jobs after it move by one. */
static enum status place_before(struct store *store, int64_t id, int64_t next, struct error *err) {
    int64_t turn, priority;
    enum status status = sql_int(&store->sql, INT64_MIN, &turn, err,
                                 "SELECT turn FROM jobs WHERE id = ?1 AND id <> ?2 AND state IN (?3, ?4)"
                                 " AND owner_id = (SELECT owner_id FROM jobs WHERE id = ?2)",
                                 "iinn", next, id, (int)JOB_QUEUED, (int)JOB_PAUSED);
    if (status == STATUS_OK && turn == INT64_MIN)
        return error_set(err, STATUS_INPUT,
                         "job %lld is not a queued job of the same owner, so no job can go before it", (long long)next);
    if (status == STATUS_OK)
        status = sql_int(&store->sql, 0, &priority, err, "SELECT priority FROM jobs WHERE id = ?", "i", next);
    if (status == STATUS_OK)
        status = sql_run(&store->sql, err, "UPDATE jobs SET turn = turn + 1 WHERE turn >= ? AND state IN (?, ?)", "inn",
                         turn, (int)JOB_QUEUED, (int)JOB_PAUSED);
    if (status == STATUS_OK)
        status =
            sql_run(&store->sql, err, "UPDATE jobs SET turn = ?, priority = ? WHERE id = ?", "iii", turn, priority, id);
    return status;
}

static enum status place(struct store *store, int64_t id, const struct job_patch *patch, struct error *err) {
    switch (patch->place) {
    case JOB_PLACE_KEEP: break;
    case JOB_PLACE_FIRST:
        return sql_run(&store->sql, err, "UPDATE jobs SET turn = (SELECT min(turn) - 1 FROM jobs) WHERE id = ?", "i",
                       id);
    case JOB_PLACE_LAST:
        return sql_run(&store->sql, err, "UPDATE jobs SET turn = (SELECT max(turn) + 1 FROM jobs) WHERE id = ?", "i",
                       id);
    case JOB_PLACE_BEFORE: return place_before(store, id, patch->before_id, err);
    }
    return STATUS_OK;
}

enum status store_job_patch(struct store *store, int64_t id, int64_t expected_revision, const struct job_patch *patch,
                            struct error *err) {
    int64_t revision;
    enum status status = store_begin(store, err);
    if (status != STATUS_OK)
        return status;
    status = sql_int(&store->sql, 0, &revision, err, "SELECT revision FROM jobs WHERE id = ?", "i", id);
    if (status == STATUS_OK && revision == 0)
        status = not_found(id, err);
    else if (status == STATUS_OK && expected_revision >= 0 && revision != expected_revision)
        status = error_set(err, STATUS_CONFLICT, "job %lld has revision %lld, not %lld", (long long)id,
                           (long long)revision, (long long)expected_revision);
    if (status == STATUS_OK)
        status = sql_run(&store->sql, err,
                         "UPDATE jobs SET " RETENTION_SET ", revision = revision + 1,"
                         " name = ifnull(?4, name), labels = ifnull(?5, labels),"
                         " priority = CASE WHEN ?6 = ?7 THEN priority ELSE ?6 END,"
                         " shared = CASE WHEN ?8 < 0 THEN shared ELSE ?8 END WHERE id = ?9",
                         "nnittnnni", (int)patch->retention.pin, (int)patch->retention.sets_expiry,
                         patch->retention.expires_ms, patch->name, patch->labels, patch->priority, INT_MIN,
                         patch->shared, id);
    if (status == STATUS_OK)
        status = place(store, id, patch, err);
    return store_end(store, status, id, err);
}

static enum status delete_job(struct store *store, int64_t id, struct error *err) {
    int64_t state;
    enum status status = store_begin_freeing(store, err);
    if (status != STATUS_OK)
        return status;
    status = sql_int(&store->sql, -1, &state, err, "SELECT state FROM jobs WHERE id = ?", "i", id);
    if (status == STATUS_OK && state < 0)
        status = not_found(id, err);
    else if (status == STATUS_OK && state == JOB_RUNNING) {
        error_set(err, STATUS_CONFLICT, "job %lld is running", (long long)id);
        status = error_hint(err, "Cancel it first.");
    }
    if (status == STATUS_OK)
        status = source_check_unread(store, id, "deleted", err);
    if (status == STATUS_OK)
        status = sql_run(&store->sql, err, "DELETE FROM jobs WHERE id = ?", "i", id);
    return store_end(store, status, id, err);
}

enum status store_job_delete(struct store *store, int64_t id, struct error *err) {
    enum status status;
    do
        status = delete_job(store, id, err);
    while (status == STATUS_NO_SPACE && store_reserve_spend(store));
    return status;
}

enum status store_job_running(struct store *store, size_t limit, struct running *list, size_t *count,
                              struct error *err) {
    sqlite3_stmt *stmt;
    *count = 0;
    store_lock(store);
    enum status status =
        sql_query(&store->sql, &stmt, err,
                  "SELECT id, ifnull(attempts.number, 0), iif(wanted = 0 AND EXISTS (SELECT 1 FROM parts WHERE"
                  " parts.job_id = id AND parts.state > 1), 1, wanted)"
                  " FROM jobs LEFT JOIN attempts ON attempts.job_id = id AND attempts.phase = 1"
                  " WHERE jobs.state = ? ORDER BY id, attempts.number LIMIT ?",
                  "ni", (int)JOB_RUNNING, (int64_t)limit);
    while (sql_next(&store->sql, stmt, &status, err))
        list[(*count)++] = (struct running){{sqlite3_column_int64(stmt, 0), sqlite3_column_int(stmt, 1)},
                                            (enum job_wanted)sqlite3_column_int(stmt, 2)};
    store_unlock(store);
    if (status != STATUS_OK)
        *count = 0;
    return status;
}
