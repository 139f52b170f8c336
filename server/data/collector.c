/* collector.c -- see collector.h. */
#include "server/data/trash.h"
#include "server/data/collector.h"

#include <pthread.h>
#include <time.h>

#include "common/clock.h"
#include "common/file.h"
#include "common/log.h"
#include "common/mem.h"
#include "server/http/handlers.h"
#include "server/http/keeping.h"
#include "server/uploads/resumable.h"
#include "server/http/problem.h"
#include "server/http/space.h"
#include "server/http/views.h"

#define ROUND_MAX 500

struct collector {
    struct api *api;
    double interval_sec;
    pthread_t thread;
    pthread_mutex_t mutex;
    pthread_cond_t changed;
    bool stopping; /* under the mutex */
};

static const char *const kind_names[] = {[EXPIRED_UPLOAD] = "upload", [EXPIRED_JOB] = "job",
                                         [EXPIRED_SCENE] = "scene"};

static enum status remove_expired(struct api *api, const struct expired *e, const char *path, int64_t now,
                                  struct error *err) {
    if (e->kind == EXPIRED_SCENE)
        pthread_mutex_lock(&api->scene_mutex);
    enum status status = store_expired_delete(api->store, e, now, err);
    if (status == STATUS_OK)
        status = e->kind == EXPIRED_UPLOAD ? resumable_forget(api->resumables, e->id, err)
                                           : trash_take(api->trash, path, err);
    if (e->kind == EXPIRED_SCENE)
        pthread_mutex_unlock(&api->scene_mutex);
    return status;
}

/* True when it is gone, or would go. */
static bool collect(struct api *api, const struct expired *e, int64_t now, bool dry_run, cJSON *items) {
    struct error err;
    uint64_t files = 0, bytes = 0;
    char *path = mem_printf("%ss/%s", kind_names[e->kind], e->id);
    char *full = file_join(api->config.data_dir, path);
    enum status status = file_tree_size(full, &files, &bytes, &err);
    if (status == STATUS_OK && !dry_run)
        status = remove_expired(api, e, path, now, &err);
    if (status != STATUS_OK && status != STATUS_CONFLICT)
        log_warning("%s %s has expired and cannot be removed: %s", kind_names[e->kind], e->id, err.message);
    else if (status == STATUS_OK && !dry_run)
        log_info("%s %s has expired: removed, %llu bytes", kind_names[e->kind], e->id,
                 (unsigned long long)bytes);
    if (status == STATUS_OK && items) {
        char time[VIEW_TIME_SIZE];
        cJSON *item = cJSON_CreateObject();
        view_time(e->expires_ms, time);
        json_add_string(item, "kind", kind_names[e->kind]);
        json_add_string(item, "id", e->id);
        json_add_string(item, "name", e->name);
        json_add_string(item, "expires_at", time);
        json_add_int(item, "files", (int64_t)files);
        json_add_int(item, "bytes", (int64_t)bytes);
        cJSON_AddItemToArray(items, item);
    }
    mem_free(full);
    mem_free(path);
    return status == STATUS_OK;
}

enum status collector_run(struct api *api, bool dry_run, cJSON *items, struct error *err) {
    enum status status;
    size_t count, removed;
    int64_t now = clock_unix_ms();
    do {
        struct expired *list;
        removed = 0;
        status = store_expired_list(api->store, now, ROUND_MAX, &list, &count, err);
        for (size_t i = 0; i < count; i++) {
            removed += collect(api, &list[i], now, dry_run, items);
            mem_free(list[i].name);
        }
        mem_free(list);
        /* What goes may let others go: a scene, once its last job's row is gone. */
    } while (status == STATUS_OK && !dry_run && removed > 0);
    return status;
}

static void *run(void *user) {
    struct collector *c = user;
    pthread_mutex_lock(&c->mutex);
    while (!c->stopping) {
        struct error err;
        struct timespec until;
        pthread_mutex_unlock(&c->mutex);
        resumables_tend(c->api->resumables);
        if (collector_run(c->api, false, NULL, &err) != STATUS_OK)
            log_warning("cannot look for what has expired: %s", err.message);
        store_reserve_renew(c->api->store);
        pthread_mutex_lock(&c->mutex);
        clock_gettime(CLOCK_MONOTONIC, &until);
        double seconds = (double)until.tv_sec + 1e-9 * (double)until.tv_nsec + c->interval_sec;
        until.tv_sec = (time_t)seconds;
        until.tv_nsec = (long)(1e9 * (seconds - (double)until.tv_sec));
        while (!c->stopping && pthread_cond_timedwait(&c->changed, &c->mutex, &until) == 0)
            ;
    }
    pthread_mutex_unlock(&c->mutex);
    return NULL;
}

enum status collector_start(struct collector **out, struct api *api, double interval_sec,
                            struct error *err) {
    struct collector *c = mem_calloc(1, sizeof *c);
    c->api = api;
    c->interval_sec = interval_sec;
    pthread_mutex_init(&c->mutex, NULL);
    pthread_condattr_t monotonic;
    pthread_condattr_init(&monotonic);
    pthread_condattr_setclock(&monotonic, CLOCK_MONOTONIC);
    pthread_cond_init(&c->changed, &monotonic);
    pthread_condattr_destroy(&monotonic);
    int failed = pthread_create(&c->thread, NULL, run, c);
    if (failed == 0) {
        *out = c;
        return STATUS_OK;
    }
    pthread_cond_destroy(&c->changed);
    pthread_mutex_destroy(&c->mutex);
    mem_free(c);
    return error_set_errno(err, failed, "cannot start the thread that removes what has expired");
}

void collector_stop(struct collector *c) {
    if (!c)
        return;
    pthread_mutex_lock(&c->mutex);
    c->stopping = true;
    pthread_cond_signal(&c->changed);
    pthread_mutex_unlock(&c->mutex);
    pthread_join(c->thread, NULL);
    pthread_cond_destroy(&c->changed);
    pthread_mutex_destroy(&c->mutex);
    mem_free(c);
}

/* --- /v1/collect ------------------------------------------------------------------------- */

struct response *collect_now(struct api *api, struct request *r) {
    bool dry_run;
    struct error err;
    struct response *refusal = keeping_dry_run(r, &dry_run);
    if (refusal)
        return refusal;
    cJSON *items = cJSON_CreateArray();
    if (collector_run(api, dry_run, items, &err) != STATUS_OK) {
        cJSON_Delete(items);
        return problem_from(r, &err);
    }
    double bytes = 0;
    const cJSON *item;
    cJSON_ArrayForEach(item, items) {
        bytes += cJSON_GetNumberValue(cJSON_GetObjectItemCaseSensitive(item, "bytes"));
    }
    cJSON *value = cJSON_CreateObject();
    json_add_bool(value, "dry_run", dry_run);
    json_add_number(value, "bytes", bytes);
    json_add(value, "items", items);
    return response_json(200, value);
}
