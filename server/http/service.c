/* service.c -- see service.h. */
#include "server/http/service.h"

#include "common/mem.h"
#include "server/events/hub.h"
#include "server/http/auth.h"
#include "server/http/auth_throttle.h"
#include "server/http/readiness.h"
#include "server/http/request_counts.h"
#include "server/http/routes.h"
#include "server/uploads/digests.h"
#include "server/uploads/resumable.h"
#include "server/uploads/upload.h"

static void renew_reserve(void *store) { store_reserve_renew(store); }

/* An upload has become a scene, which must be checked. */
static void scene_added(void *scheduler) { scheduler_wake(scheduler); }

static void maintain_uploads(void *resumables) { resumables_maintain(resumables); }

static enum status forget_upload(void *resumables, const char *id, struct error *err) {
    return resumable_remove_files(resumables, id, err);
}

/* Opens what works in the data folder. Complete uploads become scenes before leftovers are removed. */
static enum status open_folder(struct api *api, struct error *err) {
    struct store *store = api->store;
    enum status status = folder_open(&api->folder, api->config.data_dir, renew_reserve, store, err);
    scheduler_use_trash(api->scheduler, api->folder.trash);
    api->resumables = resumables_new(
        &(struct resumables_config){store, &api->folder, api->config.empty_upload_ms, scene_added, api->scheduler});
    api->collector_config =
        (struct collector_config){store, &api->folder, maintain_uploads, forget_upload, api->resumables};
    if (status == STATUS_OK)
        status = resumables_recover(api->resumables, err);
    return status == STATUS_OK ? collector_sweep(store, &api->folder, err) : status;
}

enum status service_new(struct api **out, const struct api_config *config, struct store *store,
                        struct scheduler *scheduler, struct error *err) {
    struct api *api = mem_calloc(1, sizeof *api);
    api->config = *config;
    if (api->config.empty_upload_ms <= 0)
        api->config.empty_upload_ms = config->upload_keep_ms;
    api->store = store;
    api->scheduler = scheduler;
    api->request_counts = request_counts_new();
    api->auth_throttle = auth_throttle_new();
    api->arrivals = arrivals_new();
    api->hub = hub_new(config->keepalive_sec);
    *out = api;
    enum status status =
        store_retention_set_periods(store, config->scene_keep_ms, config->job_keep_ms, config->upload_keep_ms, err);
    if (status == STATUS_OK)
        status = store_retention_set_empty_upload(store, api->config.empty_upload_ms, err);
    if (status == STATUS_OK)
        status = open_folder(api, err);
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

/* --- what the transport calls (application.h) ---------------------------------------------------- */

/* Where a token is required, no page can use the daemon without one: any name will do. */
static const char *server_names(void *user) {
    const struct api *api = user;
    return auth_is_open(api) ? api->config.server_names : NULL;
}

static struct response *find(void *user, struct request *r) {
    (void)user;
    return routes_find(r);
}

static struct response *begin(void *user, struct request *r) { return routes_begin(user, r); }

static struct response *data(void *user, struct request *r, const void *bytes, size_t length) {
    return routes_data(user, r, bytes, length);
}

static struct response *finish(void *user, struct request *r) { return routes_finish(user, r); }

static void count(void *user, const struct request *r, int status) {
    struct api *api = user;
    request_counts_add(api->request_counts, r, status);
}

static void tick(void *user, double now_sec) {
    struct api *api = user;
    hub_tick(api->hub, now_sec);
}

enum status service_listen(struct listener **l, const struct listener_config *config, struct api *api,
                           struct error *err) {
    const struct application application = {
        .user = api,
        .server_names = server_names,
        .find = find,
        .begin = begin,
        .data = data,
        .finish = finish,
        .drop = routes_drop_body,
        .count = count,
        .tick = tick,
    };
    struct listener_config own = *config;
    own.proxies = api->config.proxies;
    enum status status = listener_start(l, &own, &application, err);
    if (status == STATUS_OK)
        api->listener = *l;
    return status;
}

void service_free(struct api *api) {
    if (!api)
        return;
    store_on_change(api->store, NULL, NULL);
    store_on_digest_wanted(api->store, NULL, NULL);
    resumables_free(api->resumables);
    hub_free(api->hub);
    request_counts_free(api->request_counts);
    auth_throttle_free(api->auth_throttle);
    arrivals_free(api->arrivals);
    digests_free(api->digests);
    readiness_free(api->readiness);
    folder_close(&api->folder);
    mem_free(api);
}
