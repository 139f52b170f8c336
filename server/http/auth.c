/* auth.c -- see auth.h. */
#include "server/http/auth.h"

#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "common/mem.h"
#include "server/http/field.h"
#include "server/http/handlers.h"
#include "server/http/problem.h"
#include "server/http/routes.h"

#define COOKIE_NAME "unbake_token"
#define COOKIE_AGE_SEC (30 * 24 * 3600)

bool auth_is_open(const struct api *api) {
    return api->config.access == API_ACCESS_OPEN ||
           (api->config.access == API_ACCESS_AUTO && !store_has_users(api->store));
}

/* --- tokens ------------------------------------------------------------------------------ */

/* The cookie's value, cut out of `cookies`; false where it is absent. */
static bool read_cookie(const char *cookies, char token[TOKEN_SIZE]) {
    size_t name = strlen(COOKIE_NAME);
    for (const char *at = cookies; *at; at += strspn(at, "; ")) {
        size_t length = strcspn(at, ";");
        if (length > name && at[name] == '=' && memcmp(at, COOKIE_NAME, name) == 0) {
            snprintf(token, TOKEN_SIZE, "%.*s", (int)(length - name - 1), at + name + 1);
            return true;
        }
        at += length;
    }
    return false;
}

/* What the caller presents; false where that is nothing, or another scheme's. */
static bool read_token(const struct request *r, char token[TOKEN_SIZE]) {
    const char *authorization = request_field(r, "Authorization");
    if (authorization && strncasecmp(authorization, "Bearer ", 7) == 0) {
        snprintf(token, TOKEN_SIZE, "%s", authorization + 7 + strspn(authorization + 7, " "));
        return true;
    }
    const char *cookies = request_field(r, "Cookie");
    return cookies && read_cookie(cookies, token);
}

static struct response *unauthorized(const struct request *r, const char *detail) {
    struct response *reply = problem_full(r, 401, detail,
        "`unbaked token add NAME` on the server makes a token, `unbake login` keeps it", NULL);
    response_field(reply, "WWW-Authenticate", "Bearer realm=\"unbaked\"");
    return reply;
}

struct response *auth_check(struct api *api, struct request *r) {
    char token[TOKEN_SIZE];
    struct error err;
    bool has_token = read_token(r, token), is_open = auth_is_open(api);
    r->caller = (struct caller){.role = is_open ? ROLE_ADMIN : ROLE_VIEWER};
    if (r->route->access == ROUTE_PUBLIC)
        return NULL;
    enum status status = STATUS_OK;
    if (has_token)
        status = store_token_find(api->store, token, &r->caller, &err);
    if (status == STATUS_NOT_FOUND && is_open)
        r->caller = (struct caller){.role = ROLE_ADMIN}; /* of another daemon, or of another time */
    else if (status == STATUS_NOT_FOUND)
        return unauthorized(r, "the token is not, or no longer, valid");
    else if (status != STATUS_OK)
        return problem_from(r, &err);
    else if (!has_token && !is_open)
        return unauthorized(r, "this daemon asks for a token");
    if (r->caller.role >= r->route->access - ROUTE_VIEWER)
        return NULL;
    if (r->route->access == ROUTE_ADMIN)
        return problem(r, 403, "only an admin may do that");
    return problem(r, 403, "a token of role \"%s\" may only look", role_name(r->caller.role));
}

/* --- things ------------------------------------------------------------------------------ */

static struct response *may_only_look(const struct request *r) {
    return problem(r, 403, "it is shared with you to look at; its owner can change it");
}

bool auth_job(struct api *api, const struct request *r, enum access needed, struct job *job,
              struct response **refusal) {
    const char *number = r->target.segments[2];
    int64_t id;
    struct error err;
    if (!field_number(number, 1, INT64_MAX, &id)) {
        *refusal = problem(r, 404, "\"%.80s\" is no job's number", number);
        return false;
    }
    if (store_job_get(api->store, id, job, &err) != STATUS_OK) {
        *refusal = problem_from(r, &err);
        return false;
    }
    enum access access = caller_access_job(&r->caller, job);
    if (access >= needed)
        return true;
    job_release(job);
    *refusal = access == ACCESS_NONE ? problem(r, 404, "there is no job %lld", (long long)id)
                                     : may_only_look(r);
    return false;
}

enum status auth_find_scene(struct api *api, const struct request *r, const char *id,
                            struct scene_row *row, struct error *err) {
    enum access access;
    enum status status;
    if (!field_is_sha256(id))
        return store_scene_find(api->store, &r->caller, id, row, err);
    status = store_scene_get(api->store, id, row, err);
    if (status == STATUS_OK)
        status = store_scene_access(api->store, &r->caller, id, &access, err);
    if (status == STATUS_OK && access == ACCESS_NONE)
        status = error_set(err, STATUS_NOT_FOUND, "there is no scene %s", id);
    if (status != STATUS_OK)
        scene_row_release(row);
    return status;
}

bool auth_scene(struct api *api, const struct request *r, enum access needed, struct scene_row *row,
                struct response **refusal) {
    const char *id = r->target.segments[2];
    size_t digits = strspn(id, "0123456789abcdef");
    struct error err;
    enum access access = ACCESS_NONE;
    if (digits < 8 || digits > 64 || id[digits] != '\0') {
        *refusal = problem(r, 404, "\"%.80s\" is no scene's id: 8 to 64 lower-case hex digits", id);
        return false;
    }
    if (auth_find_scene(api, r, id, row, &err) != STATUS_OK) {
        *refusal = problem_from(r, &err);
        return false;
    }
    if (store_scene_access(api->store, &r->caller, row->id, &access, &err) != STATUS_OK)
        *refusal = problem_from(r, &err);
    else if (access < needed)
        *refusal = may_only_look(r);
    else
        return true;
    scene_row_release(row);
    return false;
}

/* --- /v1/session ------------------------------------------------------------------------- */

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
    response_field(reply, "Set-Cookie", COOKIE_NAME "=%s; Path=/; Max-Age=%d; HttpOnly; SameSite=Strict%s",
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
        reply = unauthorized(r, "the token is not, or no longer, valid");
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
