/* session.c -- /v1/session: the caller and what he keeps; the web page's token, in a cookie that no script can read. */
#include <string.h>

#include "common/clock.h"
#include "server/http/auth.h"
#include "server/http/handlers.h"
#include "server/http/views.h"
#include "server/transport/problem.h"

#define COOKIE_AGE_SEC (30 * 24 * 3600) /* 30 days */

static struct response *describe(const struct api *api, const struct request *r, const struct caller *caller) {
    uint64_t kept, limit = api->config.user_max_bytes;
    struct error err;
    if (store_user_bytes(api->store, caller->user_id, NULL, 0, &kept, &err) != STATUS_OK)
        return problem_from(r, &err);
    cJSON *value = cJSON_CreateObject();
    json_add_string(value, "user", *caller->name ? caller->name : NULL);
    json_add_string(value, "role", role_name(caller->role));
    json_add_bool(value, "open", auth_is_open(api));
    json_add_int(value, "kept_bytes", (int64_t)kept);
    if (limit > 0 && caller->user_id != 0)
        json_add_int(value, "kept_bytes_max", (int64_t)limit);
    else
        json_add(value, "kept_bytes_max", cJSON_CreateNull());
    view_add_time(value, "expires_at", caller->expires_ms);
    return response_json(200, value);
}

struct response *session_get(struct api *api, struct request *r) {
    return describe(api, r, &r->caller);
}

/* Over TLS, of this daemon or (by its header field) a proxy, the cookie is marked Secure. */
static void set_cookie(const struct api *api, const struct request *r, struct response *reply, const char *token,
                       int age_sec) {
    const char *scheme = request_field(r, "X-Forwarded-Proto");
    bool is_tls = api->config.is_tls || (scheme && strcmp(scheme, "https") == 0);
    response_field(reply, "Set-Cookie", AUTH_COOKIE "=%s; Path=/; Max-Age=%d; HttpOnly; SameSite=Strict%s", token,
                   age_sec, is_tls ? "; Secure" : "");
}

/* Seconds; a cookie does not outlive its token. */
static int cookie_age(const struct caller *caller) {
    int64_t left = caller->expires_ms ? (caller->expires_ms - clock_unix_ms()) / 1000 : COOKIE_AGE_SEC;
    return left < COOKIE_AGE_SEC ? (int)left : COOKIE_AGE_SEC;
}

struct response *session_add(struct api *api, struct request *r) {
    cJSON *body = NULL;
    struct error err;
    struct caller caller;
    const char *token = NULL;
    enum status status = json_parse(buf_text(&r->body), r->body.length, "the request body", &body, &err);
    if (status == STATUS_OK)
        status = json_string(body, "token", "the request body", NULL, &token, &err);
    struct response *reply = NULL;
    if (status != STATUS_OK)
        reply = problem(r, 400, "%s", err.message);
    else if (!token)
        reply = problem(r, 400, "the request body has no \"token\"");
    else
        status = store_token_find(api->store, token, &caller, &err);
    if (!reply && (status == STATUS_NOT_FOUND || status == STATUS_CONFLICT))
        reply = auth_reject(api, r, &err);
    if (!reply && status != STATUS_OK)
        reply = problem_from(r, &err);
    if (!reply) {
        reply = describe(api, r, &caller);
        if (reply->status == 200)
            set_cookie(api, r, reply, token, cookie_age(&caller));
    }
    cJSON_Delete(body);
    return reply;
}

struct response *session_delete(struct api *api, struct request *r) {
    struct response *reply = response_new(204);
    set_cookie(api, r, reply, "", 0);
    return reply;
}
