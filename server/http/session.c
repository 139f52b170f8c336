/* session.c -- /v1/session: the web page's token, kept in a cookie that no script can read. */
#include <string.h>

#include "server/http/auth.h"
#include "server/http/handlers.h"
#include "server/http/problem.h"

#define COOKIE_AGE_SEC (30 * 24 * 3600)

static struct response *describe(const struct api *api, const struct caller *caller) {
    cJSON *value = cJSON_CreateObject();
    json_add_string(value, "user", *caller->name ? caller->name : NULL);
    json_add_string(value, "role", role_name(caller->role));
    json_add_bool(value, "open", auth_is_open(api));
    return response_json(200, value);
}

struct response *session_get(struct api *api, struct request *r) {
    return describe(api, &r->caller);
}

/* Over TLS, ours or (as it says) a proxy's, the cookie stays there. */
static void set_cookie(const struct api *api, const struct request *r, struct response *reply,
                       const char *token, int age_sec) {
    const char *scheme = request_field(r, "X-Forwarded-Proto");
    bool is_tls = api->config.is_tls || (scheme && strcmp(scheme, "https") == 0);
    response_field(reply, "Set-Cookie", AUTH_COOKIE "=%s; Path=/; Max-Age=%d; HttpOnly; SameSite=Strict%s",
                   token, age_sec, is_tls ? "; Secure" : "");
}

struct response *session_add(struct api *api, struct request *r) {
    cJSON *body = NULL;
    struct error err;
    struct caller caller;
    const char *token = NULL;
    enum status status =
        json_parse(buf_text(&r->body), r->body.length, "the request body", &body, &err);
    if (status == STATUS_OK)
        status = json_string(body, "token", "the request body", NULL, &token, &err);
    struct response *reply = NULL;
    if (status != STATUS_OK)
        reply = problem(r, 400, "%s", err.message);
    else if (!token)
        reply = problem(r, 400, "the request body has no \"token\"");
    else
        status = store_token_find(api->store, token, &caller, &err);
    if (!reply && status == STATUS_NOT_FOUND)
        reply = auth_refuse(r, "the token is not, or no longer, valid");
    if (!reply && status != STATUS_OK)
        reply = problem_from(r, &err);
    if (!reply) {
        reply = describe(api, &caller);
        set_cookie(api, r, reply, token, COOKIE_AGE_SEC);
    }
    cJSON_Delete(body);
    return reply;
}

struct response *session_delete(struct api *api, struct request *r) {
    struct response *reply = response_new(204);
    set_cookie(api, r, reply, "", 0);
    return reply;
}
