/* system.c -- the root, health, metrics, version, settings, API description. */
#include <string.h>

#include "common/protocol.h"
#include "common/render_settings.h"
#include "common/settings.h"
#include "server/http/embedded.h"
#include "server/http/handlers.h"
#include "server/http/limits.h"
#include "server/http/page.h"
#include "server/http/readiness.h"
#include "server/net/field.h"
#include "server/transport/problem.h"

/* The web page for browsers (Accept names text/html); links for others. */
struct response *system_root(struct api *api, struct request *r) {
    (void)api;
    const char *accept = request_field(r, "Accept");
    if (accept && field_accepts(accept, "text/html")) {
        struct response *page = page_index();
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
    uint64_t room;
    if (readiness_probe(api->readiness, &room, &err) != STATUS_OK)
        return problem_full(r, 503, err.message, err.hint, NULL);
    bool waits = scheduler_waits_for_disk(api->scheduler);
    uint64_t keep = api->config.min_free_bytes + (limits_bind(r) ? api->config.admin_free_bytes : 0);
    if (room >= keep && !waits)
        return status_reply("ready");
    return problem_full(r, 503,
                        waits ? "the disk of the data folder is nearly full: jobs wait"
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
    json_add_string(value, "api", PROTOCOL_API);
    cJSON *libraries = cJSON_AddObjectToObject(value, "libraries");
    for (size_t i = 0; i < api->config.library_count; i++)
        json_add_string(libraries, api->config.libraries[i].name, api->config.libraries[i].version);
    return response_json(200, value);
}

struct response *system_settings(struct api *api, struct request *r) {
    (void)api;
    const char *word = target_query(&r->target, "kind");
    enum job_kind kind = JOB_RECONSTRUCT;
    if (word && (!job_kind_parse(word, &kind) || kind == JOB_EVALUATE))
        return problem_full(r, 400, "no jobs of that kind have settings", "known: reconstruct, render", NULL);
    cJSON *value = cJSON_CreateObject();
    json_add(value, "items", kind == JOB_RENDER ? render_settings_describe() : settings_describe());
    return response_json(200, value);
}
