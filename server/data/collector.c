/* collector.c -- see collector.h. */
#include "server/data/collector.h"

#include <stdlib.h>

#include "common/background.h"
#include "common/clock.h"
#include "common/file.h"
#include "common/log.h"
#include "common/mem.h"
#include "server/data/layout.h"
#include "server/data/trash.h"

#define ROUND_MAX 500 /* things that are listed at once */

struct collector {
    const struct collector_config *config;
    double interval_sec;
    struct background thread;
};

static const char *const kind_names[] = {[EXPIRED_UPLOAD] = "upload", [EXPIRED_JOB] = "job", [EXPIRED_SCENE] = "scene"};

const char *collector_kind_name(const struct expired *e) { return kind_names[e->kind]; }

static char *path_of(const char *data_dir, const struct expired *e) {
    return e->kind == EXPIRED_UPLOAD  ? layout_upload(data_dir, e->id)
           : e->kind == EXPIRED_SCENE ? layout_scene(data_dir, e->id)
                                      : layout_job(data_dir, strtoll(e->id, NULL, 10));
}

static enum status remove_expired(const struct collector_config *c, const struct expired *e, int64_t now,
                                  struct error *err) {
    char *path = path_of(NULL, e);
    if (e->kind == EXPIRED_SCENE)
        pthread_mutex_lock(&c->folder->scene_mutex);
    enum status status = store_expired_delete(c->store, e, now, err);
    if (status == STATUS_OK)
        status = e->kind == EXPIRED_UPLOAD ? c->forget_upload(c->uploads, e->id, err)
                                           : trash_take(c->folder->trash, path, err);
    if (e->kind == EXPIRED_SCENE)
        pthread_mutex_unlock(&c->folder->scene_mutex);
    mem_free(path);
    return status;
}

/* Removes one thing (or, in a dry run, only measures it). false: it stays; else *bytes is its disk usage. */
static bool collect(const struct collector_config *c, const struct expired *e, int64_t now, bool dry_run,
                    uint64_t *files, uint64_t *bytes) {
    struct error err;
    char *path = path_of(c->folder->dir, e);
    enum status status = file_tree_size(path, files, bytes, &err);
    if (status == STATUS_OK && !dry_run)
        status = remove_expired(c, e, now, &err);
    if (status != STATUS_OK && status != STATUS_CONFLICT)
        log_warning("%s %s has expired and cannot be removed: %s", kind_names[e->kind], e->id, err.message);
    else if (status == STATUS_OK && !dry_run)
        log_info("%s %s has expired: removed, %llu bytes", kind_names[e->kind], e->id, (unsigned long long)*bytes);
    mem_free(path);
    return status == STATUS_OK;
}

enum status collector_run(const struct collector_config *config, bool dry_run,
                          void (*found)(void *user, const struct expired *e, uint64_t files, uint64_t bytes),
                          void *user, struct error *err) {
    enum status status;
    size_t count, removed;
    int64_t now = clock_unix_ms();
    do {
        struct expired *list;
        removed = 0;
        status = store_expired_list(config->store, now, ROUND_MAX, &list, &count, err);
        for (size_t i = 0; i < count; i++) {
            uint64_t files = 0, bytes = 0;
            bool goes = collect(config, &list[i], now, dry_run, &files, &bytes);
            removed += goes;
            if (goes && found)
                found(user, &list[i], files, bytes);
            mem_free(list[i].name);
        }
        mem_free(list);
        /* Removals may make others possible: a scene, once its last job's row is gone. */
    } while (status == STATUS_OK && !dry_run && removed > 0);
    return status;
}

/* --- files without a row -------------------------------------------------------------------- */

/* Removes what has no row from the folder `inner`, which is relative to the data folder. */
static enum status sweep(struct store *store, struct folder *folder, const char *inner, enum store_files kind,
                         struct error *err) {
    char *path = file_join(folder->dir, inner), **names = NULL;
    size_t count = 0;
    enum status status = file_list(path, &names, &count, err);
    for (size_t i = 0; status == STATUS_OK && i < count; i++) {
        if (store_has_files(store, kind, names[i]))
            continue;
        char *left = file_join(inner, names[i]);
        log_info("removing %s, left over from an earlier run", left);
        status = trash_take(folder->trash, left, err);
        mem_free(left);
    }
    file_free_names(names, count);
    mem_free(path);
    return status;
}

enum status collector_sweep(struct store *store, struct folder *folder, struct error *err) {
    char *folders[] = {[STORE_FILES_SCENE] = layout_scenes(NULL),
                       [STORE_FILES_JOB] = layout_jobs(NULL),
                       [STORE_FILES_UPLOAD] = layout_uploads(NULL)};
    enum status status = STATUS_OK;
    for (size_t i = 0; i < sizeof folders / sizeof *folders; i++) {
        if (status == STATUS_OK)
            status = sweep(store, folder, folders[i], (enum store_files)i, err);
        mem_free(folders[i]);
    }
    return status;
}

/* --- the thread ---------------------------------------------------------------------------- */

static void *run(void *user) {
    struct collector *c = user;
    pthread_mutex_lock(&c->thread.mutex);
    while (!atomic_load(&c->thread.stopping)) {
        struct error err;
        pthread_mutex_unlock(&c->thread.mutex);
        c->config->maintain_uploads(c->config->uploads);
        if (collector_run(c->config, false, NULL, NULL, &err) != STATUS_OK)
            log_warning("cannot look for what has expired: %s", err.message);
        store_reserve_renew(c->config->store);
        pthread_mutex_lock(&c->thread.mutex);
        double until_sec = clock_sec() + c->interval_sec;
        while (!atomic_load(&c->thread.stopping) && background_wait_until(&c->thread, until_sec))
            ;
    }
    pthread_mutex_unlock(&c->thread.mutex);
    return NULL;
}

enum status collector_start(struct collector **out, const struct collector_config *config, double interval_sec,
                            struct error *err) {
    struct collector *c = mem_calloc(1, sizeof *c);
    c->config = config;
    c->interval_sec = interval_sec;
    enum status status = background_start(&c->thread, run, c, "removes what has expired", err);
    if (status == STATUS_OK)
        *out = c;
    else
        mem_free(c);
    return status;
}

void collector_stop(struct collector *c) {
    if (!c)
        return;
    background_stop(&c->thread);
    mem_free(c);
}
