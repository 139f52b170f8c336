/* service.c -- see service.h. */
#include "server/http/service.h"

#include <string.h>

#include "common/file.h"
#include "common/log.h"
#include "common/mem.h"
#include "server/http/brake.h"
#include "server/data/trash.h"
#include "server/uploads/digests.h"
#include "server/http/hub.h"
#include "server/uploads/resumable.h"
#include "server/http/readiness.h"
#include "server/http/tally.h"

static const char *const folders[] = {
    [STORE_FILES_SCENE] = "scenes", [STORE_FILES_JOB] = "jobs", [STORE_FILES_UPLOAD] = "uploads"};

/* Removes what is in DATA/folder and the store has no row for. */
static enum status sweep(const struct api *api, const char *folder, enum store_files kind, struct error *err) {
    char *path = file_join(api->config.data_dir, folder);
    enum status status = file_make_dirs(path, err);
    char **names = NULL;
    size_t count = 0;
    if (status == STATUS_OK)
        status = file_list(path, &names, &count, err);
    for (size_t i = 0; status == STATUS_OK && i < count; i++) {
        if (store_has_files(api->store, kind, names[i]))
            continue;
        char *inner = file_join(folder, names[i]);
        log_info("removing %s, left over from an earlier run", inner);
        status = trash_take(api->trash, inner, err);
        mem_free(inner);
    }
    file_free_names(names, count);
    mem_free(path);
    return status;
}

static void renew_reserve(void *store) {
    store_reserve_renew(store);
}

static enum status open_trash(struct api *api, struct error *err) {
    char *path = file_join(api->config.data_dir, "trash");
    enum status status = file_make_dirs(path, err);
    mem_free(path);
    return status == STATUS_OK ? trash_new(&api->trash, api->config.data_dir, renew_reserve, api->store, err) : status;
}

enum status service_new(struct api **out, const struct api_config *config, struct store *store,
                        struct scheduler *scheduler, struct error *err) {
    struct api *api = mem_calloc(1, sizeof *api);
    api->config = *config;
    if (api->config.empty_upload_ms <= 0)
        api->config.empty_upload_ms = config->upload_keep_ms;
    api->store = store;
    api->scheduler = scheduler;
    pthread_mutex_init(&api->scene_mutex, NULL);
    api->tally = tally_new();
    api->brake = brake_new();
    api->hub = hub_new(config->keepalive_sec);
    api->resumables = resumables_new(api);
    *out = api;
    enum status status = store_keep(store, config->scene_keep_ms, config->job_keep_ms,
                                    config->upload_keep_ms, err);
    if (status == STATUS_OK)
        status = store_keep_empty(store, api->config.empty_upload_ms, err);
    if (status == STATUS_OK)
        status = open_trash(api, err);
    if (status == STATUS_OK)
        status = resumables_recover(api->resumables, err);
    for (size_t i = 0; i < sizeof folders / sizeof *folders && status == STATUS_OK; i++)
        status = sweep(api, folders[i], (enum store_files)i, err);
    store_reserve_renew(store);
    if (status == STATUS_OK)
        status = readiness_new(&api->readiness, store, config->data_dir, err);
    if (status == STATUS_OK)
        status = digests_new(&api->digests, store, config->data_dir, err);
    if (status == STATUS_OK) {
        store_on_change(store, hub_changed, api->hub);
        store_on_digest_wanted(store, digests_wake, api->digests);
        return STATUS_OK;
    }
    service_free(api);
    *out = NULL;
    return status;
}

void service_free(struct api *api) {
    if (!api)
        return;
    store_on_change(api->store, NULL, NULL);
    store_on_digest_wanted(api->store, NULL, NULL);
    resumables_free(api->resumables);
    hub_free(api->hub);
    tally_free(api->tally);
    brake_free(api->brake);
    digests_free(api->digests);
    readiness_free(api->readiness);
    trash_free(api->trash);
    pthread_mutex_destroy(&api->scene_mutex);
    mem_free(api);
}
