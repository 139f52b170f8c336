/* promises.h -- what the daemon and its workers have acknowledged by some step of a log (cut.h), and
 * whether a data folder, opened by the daemon's own code, holds it.
 *
 * The marks of the log, one line each:
 *   will KIND ID                 a request is on its way that may change it or make it go
 *   gone KIND ID                 it was acknowledged that it is gone
 *   scene ID 0 STATE
 *   job ID REVISION STATE
 *   upload ID OFFSET NUMBER      its bytes are those of promise_byte(NUMBER, ...)
 * and a worker's own lines, of which "checkpoint" counts. */
#ifndef UNBAKE_TESTS_CHAOS_PROMISES_H
#define UNBAKE_TESTS_CHAOS_PROMISES_H

#include <sqlite3.h>

#include "common/log.h"
#include "common/sha256.h"
#include "server/data/attempt_folder.h"
#include "server/data/layout.h"
#include "server/http/service.h"
#include "server/uploads/resumable.h"
#include "server/worker/checkpoint.h"
#include "tests/chaos/cut.h"

#define PROMISES_MAX 400

struct promise {
    char kind[12], id[80], state[16];
    long long number;
    bool is_gone, is_unsure;
};

struct promises {
    size_t count;
    struct promise item[PROMISES_MAX];
};

/* What was found of one folder. */
struct broken {
    long lost, damaged;
    char what[1600]; /* the first */
};

static inline unsigned char promise_byte(long number, size_t at) {
    return (unsigned char)(rng_mix32((uint32_t)(number * 7919) + (uint32_t)(at / 4)) >> (8 * (at % 4)));
}

static inline struct promise *promise_of(struct promises *p, const char *kind, const char *id) {
    for (size_t i = 0; i < p->count; i++)
        if (strcmp(p->item[i].kind, kind) == 0 && strcmp(p->item[i].id, id) == 0)
            return &p->item[i];
    if (p->count == PROMISES_MAX)
        exit(1);
    struct promise *made = &p->item[p->count++];
    *made = (struct promise){.is_gone = true};
    snprintf(made->kind, sizeof made->kind, "%s", kind);
    snprintf(made->id, sizeof made->id, "%s", id);
    return made;
}

static inline const struct cut_step *promise_made(const struct cut *c, int node) {
    for (size_t i = 0; i < c->step_count; i++)
        if (c->step[i].op == OP_CREATE && c->step[i].node == node)
            return &c->step[i];
    return NULL;
}

/* The name of the folder that holds the job whose worker spoke, in its attempt's folder. */
static inline const char *promise_worker(const struct cut *c, int node) {
    const struct cut_step *attempt = promise_made(c, node), *job = attempt ? promise_made(c, attempt->folder) : NULL;
    return job ? job->name : "";
}

static inline void promises_take(struct promises *p, const struct cut *c, const struct cut_step *s) {
    char line[300], kind[12], id[80], state[16] = "";
    long long number = 0;
    snprintf(line, sizeof line, "%.*s", (int)s->length, s->text);
    if (*line == '{') { /* a worker's */
        if (sscanf(line, "{\"type\":\"checkpoint\",\"iteration\":%lld", &number) != 1)
            return;
        struct promise *saved = promise_of(p, "checkpoint", promise_worker(c, s->node));
        saved->number = number;
        saved->is_gone = false;
    } else if (sscanf(line, "will %11s %79s", kind, id) == 2) {
        promise_of(p, kind, id)->is_unsure = true;
        if (strcmp(kind, "job") == 0)
            promise_of(p, "checkpoint", id)->is_unsure = true;
    } else if (sscanf(line, "gone %11s %79s", kind, id) == 2) {
        promise_of(p, kind, id)->is_gone = true;
        promise_of(p, kind, id)->is_unsure = false;
        if (strcmp(kind, "job") == 0)
            promise_of(p, "checkpoint", id)->is_gone = true;
    } else if (sscanf(line, "%11s %79s %lld %15s", kind, id, &number, state) == 4) {
        struct promise *it = promise_of(p, kind, id);
        it->number = number;
        snprintf(it->state, sizeof it->state, "%s", state);
        it->is_gone = it->is_unsure = false;
        if (strcmp(kind, "job") == 0)
            promise_of(p, "checkpoint", id)->is_unsure = false;
    }
}

/* --- whether they are kept ------------------------------------------------------------------------ */

static inline void promise_lost(struct broken *b, long *counter, const char *format, const char *id, const char *why) {
    ++*counter;
    if (!b->what[0])
        snprintf(b->what, sizeof b->what, format, id, why);
}

static inline bool promise_same_file(const char *a, const char *b) {
    char x[SHA256_HEX_SIZE], y[SHA256_HEX_SIZE];
    return sha256_of_file(a, x, NULL) == STATUS_OK && sha256_of_file(b, y, NULL) == STATUS_OK && strcmp(x, y) == 0;
}

/* A scene that is ready has every file of the room it was made of. */
static inline bool promise_scene_is_whole(const char *data, const char *id, const char *room) {
    static const char *const names[] = {"mesh.ply", "transforms.json", "images/1.png", "images/6.png"};
    bool whole = true;
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        char *a = mem_printf("%s/scenes/%s/files/%s", data, id, names[i]), *b = file_join(room, names[i]);
        whole = whole && promise_same_file(a, b);
        mem_free(a);
        mem_free(b);
    }
    return whole;
}

static inline void promise_check_scene(const struct promise *p, struct api *api, const char *room, struct broken *b) {
    struct scene_row row;
    struct error err = {0};
    char hex[SHA256_HEX_SIZE];
    enum status status = store_scene_get(api->store, p->id, &row, &err);
    if (status != STATUS_OK) {
        if (!p->is_gone && !p->is_unsure)
            promise_lost(b, &b->lost, "scene %.12s: %s", p->id, err.message);
        return;
    }
    char *archive = mem_printf("%s/scenes/%s/archive", api->config.data_dir, p->id);
    if (sha256_of_file(archive, hex, &err) != STATUS_OK || strcmp(hex, p->id) != 0)
        promise_lost(b, &b->damaged, "scene %.12s: its archive is not what was sent: %s", p->id, err.message);
    if (row.state == SCENE_READY && !promise_scene_is_whole(api->config.data_dir, p->id, room))
        promise_lost(b, &b->damaged, "scene %.12s: %s", p->id, "it is ready and not all of its files are there");
    if (!p->is_gone && strcmp(p->state, "checking") != 0 && strcmp(p->state, scene_state_name(row.state)) != 0)
        promise_lost(b, &b->lost, "scene %.12s is not %s any more", p->id, p->state);
    if (p->is_gone && !p->is_unsure && p->state[0])
        promise_lost(b, &b->lost, "scene %.12s: %s", p->id, "it was removed and is there again");
    mem_free(archive);
    scene_row_release(&row);
}

static inline void promise_check_outputs(const struct promise *p, struct api *api, struct broken *b) {
    struct output_row *rows = NULL;
    size_t count = 0;
    struct error err = {0};
    if (store_output_list(api->store, strtoll(p->id, NULL, 10), &rows, &count, &err) != STATUS_OK || count < 8)
        promise_lost(b, &b->lost, "job %s has succeeded and its outputs are not all there: %s", p->id, err.message);
    for (size_t i = 0; i < count; i++) {
        char hex[SHA256_HEX_SIZE];
        char *path =
            mem_printf("%s/jobs/%s/attempt-%d/out/%s", api->config.data_dir, p->id, rows[i].attempt, rows[i].name);
        if (sha256_of_file(path, hex, &err) != STATUS_OK || strcmp(hex, rows[i].sha256) != 0)
            promise_lost(b, &b->damaged, "job %s: its output %s is not what was announced", p->id, rows[i].name);
        mem_free(path);
        output_row_release(&rows[i]);
    }
    mem_free(rows);
}

/* Its revision has grown, or it is as it was said to be. */
static inline void promise_check_job(const struct promise *p, struct api *api, struct broken *b) {
    struct job job;
    struct error err = {0};
    enum status status = store_job_get(api->store, strtoll(p->id, NULL, 10), &job, &err);
    if (status != STATUS_OK) {
        if (!p->is_gone && !p->is_unsure)
            promise_lost(b, &b->lost, "job %s: %s", p->id, err.message);
        return;
    }
    if (p->is_gone && !p->is_unsure && p->state[0])
        promise_lost(b, &b->lost, "job %s: %s", p->id, "it was removed and is there again");
    const char *state = job_state_name(job.state);
    enum job_state said = JOB_QUEUED;
    job_state_parse(p->state, &said);
    bool is_as_said = strcmp(state, p->state) == 0;
    if (job.revision < p->number || (job.revision == p->number && !is_as_said) ||
        (!p->is_unsure && !p->is_gone && job_is_terminal(said) && !is_as_said))
        promise_lost(b, &b->lost, "job %s is not %s any more", p->id, p->state);
    if (job.state == JOB_SUCCEEDED)
        promise_check_outputs(p, api, b);
    job_release(&job);
}

static inline void promise_check_upload(const struct promise *p, struct api *api, struct broken *b) {
    struct upload_row row = {0};
    struct error err = {0};
    enum status status = resumable_status(api->resumables, p->id, &row, &err);
    if (status != STATUS_OK || row.received < (uint64_t)p->number) {
        if (!p->is_gone && !p->is_unsure)
            promise_lost(b, &b->lost, "upload %.12s has lost bytes: %s", p->id, err.message);
    } else if (!*row.scene_id) {
        char *path = mem_printf("%s/uploads/%s", api->config.data_dir, p->id);
        struct buf bytes;
        buf_init(&bytes, (size_t)64 << 20);
        bool is_same = file_read(path, &bytes, &err) == STATUS_OK && bytes.length >= row.received;
        for (size_t i = 0; is_same && i < row.received; i++)
            is_same = (unsigned char)bytes.data[i] == promise_byte(strtol(p->state, NULL, 10), i);
        if (!is_same)
            promise_lost(b, &b->damaged, "upload %.12s holds bytes that were not sent: %s", p->id, err.message);
        buf_release(&bytes);
        mem_free(path);
    }
    upload_row_release(&row);
}

/* Every checkpoint that is there can be opened, and holds what was saved last, or more. */
static inline void promise_check_checkpoint(const struct promise *p, const char *data, const char *fingerprint,
                                            struct broken *b) {
    struct checkpoint *checkpoint = NULL;
    struct error err = {0};
    char *holder = NULL, *folder, *path, note[512];
    if (attempt_folder_with_checkpoint(data, strtoll(p->id, NULL, 10), &holder, &err) != STATUS_OK)
        promise_lost(b, &b->lost, "job %s: %s", p->id, err.message);
    folder = holder ? layout_checkpoint(holder) : mem_strdup("none");
    path = file_join(data, folder);
    mem_free(folder);
    mem_free(holder);
    sqlite3 *db = NULL;
    sqlite3_stmt *stmt = NULL;
    if (access(path, F_OK) != 0) {
        if (!p->is_gone && !p->is_unsure)
            promise_lost(b, &b->lost, "job %s: %s", p->id, "its checkpoint is not there");
        mem_free(path);
        return;
    }
    if (checkpoint_open(&checkpoint, path, fingerprint, note, &err) != STATUS_OK || note[0])
        promise_lost(b, &b->damaged, "job %s: its checkpoint does not open: %s", p->id, note[0] ? note : err.message);
    checkpoint_close(checkpoint);
    long long iteration = -1;
    if (sqlite3_open(path, &db) == SQLITE_OK &&
        sqlite3_prepare_v2(db, "SELECT iteration FROM newest", -1, &stmt, NULL) == SQLITE_OK &&
        sqlite3_step(stmt) == SQLITE_ROW)
        iteration = sqlite3_column_int64(stmt, 0);
    sqlite3_finalize(stmt);
    sqlite3_close(db);
    if (!p->is_gone && iteration < p->number)
        promise_lost(b, &b->lost, "job %s: %s", p->id, "its checkpoint is older than the last that was saved");
    mem_free(path);
}

static inline void promise_check_integrity(const char *data, struct broken *b) {
    sqlite3 *db = NULL;
    sqlite3_stmt *stmt = NULL;
    char *path = file_join(data, "state.db");
    if (sqlite3_open(path, &db) != SQLITE_OK ||
        sqlite3_prepare_v2(db, "PRAGMA integrity_check", -1, &stmt, NULL) != SQLITE_OK ||
        sqlite3_step(stmt) != SQLITE_ROW || strcmp((const char *)sqlite3_column_text(stmt, 0), "ok") != 0)
        promise_lost(b, &b->damaged, "%s fails its integrity check: %s", path, sqlite3_errmsg(db));
    sqlite3_finalize(stmt);
    sqlite3_close(db);
    mem_free(path);
}

/* Opens the folder as the daemon does and looks after every promise. */
static inline void promises_check(const struct promises *p, const char *data, const char *room, const char *fingerprint,
                                  struct broken *b) {
    struct error err = {0};
    struct store *store = NULL;
    struct scheduler *scheduler = NULL;
    struct api *api = NULL;
    struct scheduler_config work = {.data_dir = data, .max_running = 1};
    struct api_config config = {.data_dir = data,
                                .max_attempts = 2,
                                .queue_limit = 1000,
                                .max_upload_bytes = 8 << 20,
                                .max_streams = 1,
                                .keepalive_sec = 60,
                                .upload_keep_ms = 86400000,
                                .server_names = ""};
    enum status status = store_open(&store, data, &err);
    if (status == STATUS_OK)
        status = scheduler_new(&scheduler, &work, store, &err);
    if (status == STATUS_OK)
        status = service_new(&api, &config, store, scheduler, &err);
    if (status == STATUS_OK)
        status = store_probe(store, &err);
    if (status != STATUS_OK)
        promise_lost(b, &b->damaged, "%s does not open: %s", data, err.message);
    for (size_t i = 0; status == STATUS_OK && i < p->count; i++) {
        const struct promise *it = &p->item[i];
        if (strcmp(it->kind, "scene") == 0)
            promise_check_scene(it, api, room, b);
        else if (strcmp(it->kind, "job") == 0)
            promise_check_job(it, api, b);
        else if (strcmp(it->kind, "upload") == 0)
            promise_check_upload(it, api, b);
        else
            promise_check_checkpoint(it, data, fingerprint, b);
    }
    service_free(api);
    scheduler_free(scheduler);
    store_close(store);
    promise_check_integrity(data, b);
}

#endif
