/* system.c -- what the daemon says about itself. */
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "common/file.h"
#include "common/protocol.h"
#include "common/settings.h"
#include "server/http/embedded.h"
#include "server/http/events.h"
#include "server/http/field.h"
#include "server/http/handlers.h"
#include "server/http/listener.h"
#include "server/http/problem.h"

/* --- the web page -------------------------------------------------------------------------- */

/* A file of the page: it runs what comes from here and nothing else, and nobody frames it. */
static struct response *page_part(const char *content_type, const void *text, size_t length) {
    struct response *reply = response_static(content_type, text, length);
    response_field(reply, "Content-Security-Policy",
                   "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:;"
                   " connect-src 'self'; form-action 'self'; frame-ancestors 'none'; base-uri 'none'");
    response_field(reply, "Referrer-Policy", "no-referrer");
    response_field(reply, "Cache-Control", "no-cache");
    return reply;
}

struct response *system_page_css(struct api *api, struct request *r) {
    (void)api, (void)r;
    return page_part("text/css; charset=utf-8", embedded_page_css, embedded_page_css_size);
}

struct response *system_page_js(struct api *api, struct request *r) {
    (void)api, (void)r;
    return page_part("text/javascript; charset=utf-8", embedded_page_js, embedded_page_js_size);
}

/* A page for browsers, which name text/html; links for all others. */
struct response *system_root(struct api *api, struct request *r) {
    (void)api;
    const char *accept = request_field(r, "Accept");
    if (accept && field_accepts(accept, "text/html")) {
        struct response *page = page_part("text/html; charset=utf-8", embedded_index_html, embedded_index_html_size);
        response_field(page, "Vary", "Accept");
        return page;
    }
    static const char *const links[][2] = {
        {"openapi", "/openapi.json"}, {"version", "/v1/version"}, {"settings", "/v1/settings"},
        {"scenes", "/v1/scenes"},     {"uploads", "/v1/uploads"}, {"jobs", "/v1/jobs"},
        {"health", "/healthz"},       {"ready", "/readyz"},       {"metrics", "/metrics"},
    };
    cJSON *value = cJSON_CreateObject();
    json_add_string(value, "name", "unbaked");
    json_add_string(value, "version", UNBAKE_VERSION);
    cJSON *object = cJSON_AddObjectToObject(value, "links");
    for (size_t i = 0; i < sizeof links / sizeof *links; i++)
        json_add_string(object, links[i][0], links[i][1]);
    struct response *reply = response_json(200, value);
    response_field(reply, "Vary", "Accept");
    return reply;
}

/* --- health and descriptions --------------------------------------------------------------- */

static struct response *status_reply(const char *word) {
    cJSON *value = cJSON_CreateObject();
    json_add_string(value, "status", word);
    return response_json(200, value);
}

struct response *system_healthz(struct api *api, struct request *r) {
    (void)api, (void)r;
    return status_reply("ok");
}

struct response *system_readyz(struct api *api, struct request *r) {
    struct error err;
    if (store_probe(api->store, &err) != STATUS_OK)
        return problem_full(r, 503, err.message, err.hint, NULL);
    struct response *full = api_check_room(api, r, 0);
    bool waits = scheduler_waits_for_disk(api->scheduler);
    if (!full && !waits)
        return status_reply("ready");
    response_free(full);
    return problem_full(r, 503, waits ? "the disk of the data folder is nearly full: jobs wait"
                                      : "the disk of the data folder is nearly full",
                        "delete jobs or scenes that nobody needs", NULL);
}

struct response *system_openapi(struct api *api, struct request *r) {
    (void)api, (void)r;
    return response_static(MIME_JSON, embedded_openapi_json, embedded_openapi_json_size);
}

struct response *system_version(struct api *api, struct request *r) {
    (void)r;
    cJSON *value = cJSON_CreateObject();
    json_add_string(value, "name", "unbaked");
    json_add_string(value, "version", UNBAKE_VERSION);
    json_add_string(value, "api", "v1");
    cJSON *libraries = cJSON_AddObjectToObject(value, "libraries");
    for (size_t i = 0; i < api->config.library_count; i++)
        json_add_string(libraries, api->config.libraries[i].name, api->config.libraries[i].version);
    return response_json(200, value);
}

struct response *system_settings(struct api *api, struct request *r) {
    (void)api, (void)r;
    cJSON *value = cJSON_CreateObject();
    json_add(value, "items", settings_describe());
    return response_json(200, value);
}

/* --- figures ----------------------------------------------------------------------------- */

static void metric(struct buf *b, const char *name, const char *type, const char *help, double value) {
    buf_printf(b, "# HELP unbaked_%s %s\n# TYPE unbaked_%s %s\nunbaked_%s %.17g\n", name, help, name, type,
               name, value);
}

static void metric_head(struct buf *b, const char *name, const char *type, const char *help) {
    buf_printf(b, "# HELP unbaked_%s %s\n# TYPE unbaked_%s %s\n", name, help, name, type);
}

static double resident_bytes(void) {
    unsigned long long total, resident = 0;
    FILE *file = fopen("/proc/self/statm", "re");
    if (!file)
        return 0;
    if (fscanf(file, "%llu %llu", &total, &resident) != 2)
        resident = 0;
    fclose(file);
    return (double)resident * (double)sysconf(_SC_PAGESIZE);
}

static void store_metrics(struct buf *b, const struct store_counts *counts) {
    metric_head(b, "jobs", "gauge", "Jobs by state.");
    for (int i = 0; i < JOB_STATE_COUNT; i++)
        buf_printf(b, "unbaked_jobs{state=\"%s\"} %lld\n", job_state_name((enum job_state)i),
                   (long long)counts->jobs_by_state[i]);
    metric_head(b, "scenes", "gauge", "Scenes by state.");
    for (int i = 0; i < SCENE_STATE_COUNT; i++)
        buf_printf(b, "unbaked_scenes{state=\"%s\"} %lld\n", scene_state_name((enum scene_state)i),
                   (long long)counts->scenes_by_state[i]);
    metric(b, "attempts", "gauge", "Attempts of the jobs that are kept.", (double)counts->attempts);
    metric(b, "events", "gauge", "Stored events.", (double)counts->events);
    metric(b, "wal_bytes", "gauge", "Size of the database's write-ahead log.", (double)counts->wal_bytes);
}

struct response *system_metrics(struct api *api, struct request *r) {
    struct store_counts counts;
    struct error err;
    uint64_t room = 0;
    if (store_count(api->store, &counts, &err) != STATUS_OK)
        return problem_from(r, &err);
    struct buf b;
    buf_init(&b, (size_t)1 << 20);
    metric_head(&b, "build_info", "gauge", "Always 1; the version is a label.");
    buf_printf(&b, "unbaked_build_info{version=\"%s\"} 1\n", UNBAKE_VERSION);
    store_metrics(&b, &counts);
    metric(&b, "workers", "gauge", "Worker processes alive.", scheduler_running(api->scheduler));
    metric_head(&b, "http_requests_total", "counter", "Requests answered, by class of status.");
    for (int i = 1; i < 6; i++)
        buf_printf(&b, "unbaked_http_requests_total{code=\"%dxx\"} %llu\n", i,
                   (unsigned long long)atomic_load(&api->request_count[i]));
    metric(&b, "uploaded_bytes_total", "counter", "Bytes of bundles received.",
           (double)atomic_load(&api->uploaded_bytes));
    metric(&b, "event_streams", "gauge", "Open event streams.", (double)hub_count(api->hub));
    if (api->listener) {
        metric(&b, "connections", "gauge", "Open connections.", (double)listener_connections(api->listener));
        metric(&b, "late_connections_total", "counter", "Connections shut for being too slow.",
               (double)listener_late(api->listener));
    }
    if (file_free_bytes(api->config.data_dir, &room, NULL) == STATUS_OK)
        metric(&b, "disk_free_bytes", "gauge", "Free space of the data folder's disk.", (double)room);
    metric(&b, "resident_bytes", "gauge", "Memory of the daemon itself.", resident_bytes());
    size_t length = b.length;
    return response_text(200, "text/plain; version=0.0.4; charset=utf-8", buf_detach(&b), length);
}
