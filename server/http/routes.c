/* routes.c -- see routes.h. */
#include "server/http/routes.h"

#include <stdio.h>
#include <string.h>

#include "common/protocol.h"
#include "server/http/auth.h"
#include "server/http/handlers.h"
#include "server/http/jobs/job_files.h"
#include "server/http/nodes/node.h"
#include "server/http/nodes/node_body.h"
#include "server/http/scene_body.h"
#include "server/http/upload_body.h"
#include "server/http/whole_body.h"
#include "server/net/field.h"
#include "server/transport/problem.h"
#include "server/uploads/upload.h"

static const struct route table[] = {
    {METHOD_GET, "/", ROUTE_PUBLIC, system_root, 0, PACE_AT_ONCE, NULL},
    {METHOD_GET, "/web/{name}", ROUTE_PUBLIC, page_file, 0, PACE_AT_ONCE, NULL},
    {METHOD_GET, "/healthz", ROUTE_PUBLIC, system_healthz, 0, PACE_AT_ONCE, NULL},
    {METHOD_GET, "/readyz", ROUTE_PUBLIC, system_readyz, 0, PACE_SLOW, NULL},
    {METHOD_GET, "/metrics", ROUTE_VIEWER, system_metrics, 0, PACE_QUICK, NULL},
    {METHOD_GET, "/openapi.json", ROUTE_PUBLIC, system_openapi, 0, PACE_AT_ONCE, NULL},
    {METHOD_GET, "/v1/version", ROUTE_VIEWER, system_version, 0, PACE_QUICK, ""},
    {METHOD_GET, "/v1/session", ROUTE_VIEWER, session_get, 0, PACE_QUICK, ""},
    {METHOD_POST, "/v1/session", ROUTE_PUBLIC, session_add, ROUTE_BODY_JSON, PACE_QUICK, ""},
    {METHOD_DELETE, "/v1/session", ROUTE_PUBLIC, session_delete, 0, PACE_AT_ONCE, ""},
    {METHOD_GET, "/v1/users", ROUTE_ADMIN, users_list, 0, PACE_QUICK, ""},
    {METHOD_GET, "/v1/tokens", ROUTE_ADMIN, tokens_list, 0, PACE_QUICK, ""},
    {METHOD_POST, "/v1/tokens", ROUTE_ADMIN, tokens_add, ROUTE_BODY_JSON, PACE_QUICK, ""},
    {METHOD_DELETE, "/v1/tokens/{token}", ROUTE_ADMIN, tokens_delete, 0, PACE_QUICK, ""},
    {METHOD_GET, "/v1/settings", ROUTE_VIEWER, system_settings, 0, PACE_QUICK, "kind"},
    {METHOD_GET, "/v1/scenes", ROUTE_VIEWER, scenes_list, 0, PACE_QUICK, "limit cursor"},
    {METHOD_POST, "/v1/scenes", ROUTE_USER, scenes_add, ROUTE_BODY_UPLOAD, PACE_SLOW, "name reading"},
    {METHOD_GET, "/v1/scenes/{scene}", ROUTE_VIEWER, scenes_get, 0, PACE_QUICK, ""},
    {METHOD_PATCH, "/v1/scenes/{scene}", ROUTE_USER, scenes_patch, ROUTE_BODY_JSON, PACE_QUICK, ""},
    {METHOD_DELETE, "/v1/scenes/{scene}", ROUTE_USER, scenes_delete, 0, PACE_SLOW, "dry_run"},
    {METHOD_GET, "/v1/scenes/{scene}/preview/{name}", ROUTE_VIEWER, previews_get, 0, PACE_QUICK, ""},
    {METHOD_OPTIONS, "/v1/uploads", ROUTE_PUBLIC, uploads_options, 0, PACE_AT_ONCE, ""},
    {METHOD_GET, "/v1/uploads", ROUTE_VIEWER, uploads_list, 0, PACE_QUICK, "sha256 limit cursor"},
    {METHOD_POST, "/v1/uploads", ROUTE_USER, uploads_add, 0, PACE_SLOW, ""},
    {METHOD_OPTIONS, "/v1/uploads/{upload}", ROUTE_PUBLIC, uploads_options, 0, PACE_AT_ONCE, ""},
    {METHOD_GET, "/v1/uploads/{upload}", ROUTE_VIEWER, uploads_get, 0, PACE_SLOW, ""},
    {METHOD_PATCH, "/v1/uploads/{upload}", ROUTE_USER, uploads_patch, ROUTE_BODY_PATCH, PACE_SLOW, ""},
    {METHOD_DELETE, "/v1/uploads/{upload}", ROUTE_USER, uploads_delete, 0, PACE_SLOW, "dry_run"},
    {METHOD_POST, "/v1/collect", ROUTE_ADMIN, collect_now, 0, PACE_SLOW, "dry_run"},
    {METHOD_GET, "/v1/jobs", ROUTE_VIEWER, jobs_list, 0, PACE_QUICK, "state kind source label limit cursor"},
    {METHOD_POST, "/v1/jobs", ROUTE_USER, jobs_add, ROUTE_BODY_JSON, PACE_QUICK, "dry_run"},
    {METHOD_GET, "/v1/jobs/{job}", ROUTE_VIEWER, jobs_get, 0, PACE_QUICK, "wait"},
    {METHOD_PATCH, "/v1/jobs/{job}", ROUTE_USER, jobs_patch, ROUTE_BODY_JSON, PACE_QUICK, ""},
    {METHOD_DELETE, "/v1/jobs/{job}", ROUTE_USER, jobs_delete, 0, PACE_SLOW, "dry_run"},
    {METHOD_PUT, "/v1/jobs/{job}/files/{name}", ROUTE_USER, job_files_put, ROUTE_BODY_JOB_FILE, PACE_SLOW, ""},
    {METHOD_POST, "/v1/jobs/{job}/cancel", ROUTE_USER, job_action_cancel, 0, PACE_QUICK, ""},
    {METHOD_POST, "/v1/jobs/{job}/pause", ROUTE_USER, job_action_pause, 0, PACE_QUICK, ""},
    {METHOD_POST, "/v1/jobs/{job}/resume", ROUTE_USER, job_action_resume, 0, PACE_QUICK, ""},
    {METHOD_POST, "/v1/jobs/{job}/retry", ROUTE_USER, job_action_retry, 0, PACE_QUICK, "from"},
    {METHOD_POST, "/v1/jobs/{job}/extend", ROUTE_USER, job_action_extend, ROUTE_BODY_JSON, PACE_QUICK, ""},
    {METHOD_POST, "/v1/jobs/{job}/webhook/redeliver", ROUTE_USER, job_action_redeliver, 0, PACE_QUICK, ""},
    {METHOD_GET, "/v1/events", ROUTE_VIEWER, events_all, 0, PACE_QUICK, "after follow wait"},
    {METHOD_GET, "/v1/jobs/{job}/events", ROUTE_VIEWER, events_get, 0, PACE_QUICK, "after follow wait"},
    {METHOD_GET, "/v1/jobs/{job}/log", ROUTE_VIEWER, jobs_log, 0, PACE_QUICK, "bytes"},
    {METHOD_GET, "/v1/jobs/{job}/outputs", ROUTE_VIEWER, outputs_list, 0, PACE_QUICK, ""},
    {METHOD_GET, "/v1/jobs/{job}/outputs/{name...}", ROUTE_VIEWER, outputs_get, 0, PACE_QUICK, ""},
    {METHOD_POST, "/v1/attempts/{job}/{number}/claim", ROUTE_NODE, nodes_claim, ROUTE_BODY_JSON, PACE_QUICK, ""},
    {METHOD_POST, "/v1/attempts/{job}/{number}/report", ROUTE_NODE, nodes_report, ROUTE_BODY_JSON, PACE_QUICK, ""},
    {METHOD_POST, "/v1/attempts/{job}/{number}/end", ROUTE_NODE, nodes_end, ROUTE_BODY_JSON, PACE_QUICK, ""},
    {METHOD_GET, "/v1/attempts/{job}/{number}/scene", ROUTE_NODE, node_files_scene, 0, PACE_SLOW, ""},
    {METHOD_GET, "/v1/attempts/{job}/{number}/scene/{name...}", ROUTE_NODE, node_files_scene_get, 0, PACE_QUICK, ""},
    {METHOD_GET, "/v1/attempts/{job}/{number}/checkpoint", ROUTE_NODE, node_files_checkpoint, 0, PACE_SLOW, ""},
    {METHOD_GET, "/v1/attempts/{job}/{number}/checkpoint/{name}", ROUTE_NODE, node_files_checkpoint_get, 0, PACE_QUICK,
     ""},
    {METHOD_PUT, "/v1/attempts/{job}/{number}/checkpoint/{name}", ROUTE_NODE, node_files_checkpoint_put,
     ROUTE_BODY_FILE, PACE_SLOW, "first"},
    {METHOD_PUT, "/v1/attempts/{job}/{number}/outputs/{name...}", ROUTE_NODE, node_files_output_put, ROUTE_BODY_FILE,
     PACE_SLOW, ""},
    {METHOD_PUT, "/v1/attempts/{job}/{number}/log", ROUTE_NODE, node_files_log_put, ROUTE_BODY_FILE, PACE_QUICK, ""},
};

const struct route *routes_table(size_t *count) {
    *count = sizeof table / sizeof *table;
    return table;
}

static bool matches(const char *pattern, const struct target *t) {
    size_t i = 0;
    for (const char *at = pattern + 1; *at; i++) {
        size_t length = strcspn(at, "/");
        if (i == t->segment_count)
            return false;
        bool is_rest = length > 4 && memcmp(at + length - 4, "...}", 4) == 0;
        if (is_rest)
            return true;
        if (*at != '{' && (strlen(t->segments[i]) != length || memcmp(at, t->segments[i], length) != 0))
            return false;
        at += length;
        if (*at == '/')
            at++;
    }
    return i == t->segment_count;
}

static bool is_tus(const struct request *r) {
    return r->target.segment_count >= 2 && strcmp(r->target.segments[0], "v1") == 0 &&
           strcmp(r->target.segments[1], "uploads") == 0;
}

/* Every reply to a tus request names the protocol's version, early refusals too. NULL stays NULL. */
static struct response *answer(const struct request *r, struct response *reply) {
    if (reply && is_tus(r))
        response_field(reply, "Tus-Resumable", TUS_VERSION);
    return reply;
}

/* X-HTTP-Method-Override of the tus protocol, for clients that can only send GET and POST. */
static void override_method(struct request *r) {
    const char *other = request_field(r, "X-HTTP-Method-Override");
    if (!other || r->method != METHOD_POST || r->target.segment_count != 3 || !is_tus(r))
        return;
    if (strcmp(other, "PATCH") == 0)
        r->method = METHOD_PATCH;
    else if (strcmp(other, "DELETE") == 0)
        r->method = METHOD_DELETE;
}

/* 404, or 405 where the path takes another method. */
static struct response *no_route(const struct request *r) {
    static const char *const names[] = {"GET, HEAD", "POST", "PATCH", "DELETE", "OPTIONS", "PUT"};
    char allow[64] = "";
    for (size_t i = 0; i < sizeof table / sizeof *table; i++) {
        if (!matches(table[i].pattern, &r->target))
            continue;
        size_t used = strlen(allow);
        snprintf(allow + used, sizeof allow - used, "%s%s", used ? ", " : "", names[table[i].method]);
    }
    if (!*allow)
        return problem_full(r, 404, "there is nothing at this path", "GET / and GET /openapi.json say what there is",
                            NULL);
    char detail[96];
    snprintf(detail, sizeof detail, "this path supports only %s", allow);
    bool is_other = (r->method == METHOD_COUNT || r->method == METHOD_PUT) && strstr(allow, "POST");
    struct response *reply =
        problem_full(r, 405, detail, is_other ? "curl -T sends PUT unless -X POST is given" : "", NULL);
    response_field(reply, "Allow", "%s", allow);
    return reply;
}

static struct response *check_query(const struct request *r) {
    for (size_t i = 0; r->route->query && i < r->target.query_count; i++) {
        const char *name = r->target.names[i];
        size_t length = strlen(name);
        const char *at = length ? r->route->query : "";
        while (*at && !(strncmp(at, name, length) == 0 && (at[length] == ' ' || !at[length]))) {
            at += strcspn(at, " ");
            at += strspn(at, " ");
        }
        if (!*at)
            return problem(r, 400, "unknown query parameter \"%.100s\"%s%s", name, *r->route->query ? "; known: " : "",
                           r->route->query);
    }
    return NULL;
}

static bool is_json(const struct request *r) {
    const char *type = request_field(r, "Content-Type");
    return type && (field_is_type(type, MIME_JSON) ||
                    (r->method == METHOD_PATCH && field_is_type(type, "application/merge-patch+json")));
}

static enum route_body body_of(const struct request *r) {
    return r->route->body == ROUTE_BODY_PATCH && is_json(r) ? ROUTE_BODY_JSON : r->route->body;
}

static bool is_stored(enum route_body body) {
    return body == ROUTE_BODY_UPLOAD || body == ROUTE_BODY_FILE || body == ROUTE_BODY_JOB_FILE ||
           body == ROUTE_BODY_PATCH;
}

static struct response *check_media_type(const struct request *r) {
    const char *type = request_field(r, "Content-Type");
    const char *coding = request_field(r, "Content-Encoding");
    enum route_body body = body_of(r);
    static const char *const accepted[] = {[ROUTE_BODY_IGNORED] = MIME_JSON,
                                           [ROUTE_BODY_JSON] = MIME_JSON,
                                           [ROUTE_BODY_UPLOAD] = "application/octet-stream",
                                           [ROUTE_BODY_FILE] = "application/octet-stream",
                                           [ROUTE_BODY_JOB_FILE] = "application/octet-stream",
                                           [ROUTE_BODY_PATCH] = MIME_TUS ", " MIME_JSON};
    const char *detail = NULL;
    if (coding && r->has_body)
        detail = "a body with a Content-Encoding is not supported";
    else if ((body == ROUTE_BODY_UPLOAD || body == ROUTE_BODY_JOB_FILE) && type &&
             field_is_type(type, "multipart/form-data"))
        detail = "a form is not supported: send the file itself as the body, as curl -T does";
    else if (body == ROUTE_BODY_JSON && !is_json(r))
        detail = "the body must be JSON, and its Content-Type application/json";
    else if (body == ROUTE_BODY_PATCH && !(type && field_is_type(type, MIME_TUS)))
        detail = "Content-Type must be " MIME_TUS ", or " MIME_JSON " for a change of how long it is kept";
    if (!detail)
        return NULL;
    struct response *reply = problem(r, 415, "%s", detail);
    response_field(reply, "Accept", "%s", accepted[r->route->body]);
    return reply;
}

static struct response *too_large(const struct request *r, uint64_t limit) {
    cJSON *members = cJSON_CreateObject();
    json_add_int(members, "limit_bytes", (int64_t)limit);
    char detail[128];
    snprintf(detail, sizeof detail, "the body is larger than %llu bytes", (unsigned long long)limit);
    bool is_option = limit != ROUTES_BODY_MAX && limit != NODE_FILE_MAX;
    return problem_full(r, 413, detail, is_option ? "an administrator can raise the option max_upload_mib" : "",
                        members);
}

struct response *routes_find(struct request *r) {
    override_method(r);
    for (size_t i = 0; i < sizeof table / sizeof *table && !r->route; i++)
        if ((int)table[i].method == r->method && matches(table[i].pattern, &r->target))
            r->route = &table[i];
    if (!r->route)
        return answer(r, no_route(r));
    enum route_body body = body_of(r);
    r->pace = r->route->pace;
    r->is_body_stored = is_stored(body);
    return NULL;
}

static uint64_t body_max(const struct api *api, enum route_body body) {
    if (body == ROUTE_BODY_FILE) /* outputs and checkpoints are as large as the job makes them */
        return NODE_FILE_MAX;
    return is_stored(body) ? api->config.max_upload_bytes : ROUTES_BODY_MAX;
}

static struct response *begin(struct api *api, struct request *r) {
    struct response *refusal = auth_check(api, r);
    if (!refusal)
        refusal = check_query(r);
    if (!refusal)
        refusal = check_media_type(r);
    if (!refusal && r->route->access == ROUTE_NODE)
        refusal = node_check(api, r);
    if (refusal)
        return refusal;
    enum route_body body = body_of(r);
    if (body == ROUTE_BODY_PATCH)
        return upload_body_begin(api, r); /* the upload's length is the limit */
    uint64_t limit = body_max(api, body);
    if (r->content_length > 0 && (uint64_t)r->content_length > limit)
        return too_large(r, limit);
    buf_init(&r->body, ROUTES_BODY_MAX);
    return body == ROUTE_BODY_UPLOAD     ? scene_body_begin(api, r)
           : body == ROUTE_BODY_FILE     ? node_body_begin(api, r)
           : body == ROUTE_BODY_JOB_FILE ? job_files_begin(api, r)
                                         : NULL;
}

struct response *routes_begin(struct api *api, struct request *r) {
    struct response *refusal = begin(api, r);
    if (refusal)
        routes_drop_body(r);
    return answer(r, refusal);
}

static struct response *take(struct api *api, struct request *r, const void *data, size_t length) {
    if (r->upload) {
        uint64_t limit = body_max(api, r->route->body);
        if (upload_bytes(r->upload) + length > limit)
            return too_large(r, limit);
        return r->route->body == ROUTE_BODY_FILE ? node_body_data(api, r, data, length)
                                                 : whole_body_data(api, r, data, length);
    }
    if (r->patch)
        return upload_body_data(api, r, data, length);
    return buf_append(&r->body, data, length) ? NULL : too_large(r, ROUTES_BODY_MAX);
}

struct response *routes_data(struct api *api, struct request *r, const void *data, size_t length) {
    struct response *refusal = take(api, r, data, length);
    if (refusal)
        routes_drop_body(r);
    return answer(r, refusal);
}

struct response *routes_finish(struct api *api, struct request *r) {
    struct response *reply = answer(r, r->route->handle(api, r));
    routes_drop_body(r); /* before the reply: limits must not count it against the next request */
    return reply;
}

void routes_drop_body(struct request *r) {
    buf_release(&r->body);
    upload_free(r->upload);
    r->upload = NULL;
    upload_body_drop(r->patch);
    r->patch = NULL;
}
