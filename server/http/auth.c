/* auth.c -- see auth.h. */
#include "server/http/auth.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "common/clock.h"
#include "common/log.h"
#include "server/http/auth_throttle.h"
#include "server/http/route.h"
#include "server/net/address.h"
#include "server/net/field.h"
#include "server/transport/problem.h"

bool auth_is_open(const struct api *api) {
    return api->config.access == API_ACCESS_OPEN ||
           (api->config.access == API_ACCESS_AUTO && !store_has_users(api->store));
}

/* --- tokens ------------------------------------------------------------------------------ */

/* Cuts the cookie's value out of `cookies`; false where it is absent. */
static bool read_cookie(const char *cookies, char token[TOKEN_SIZE]) {
    size_t name = strlen(AUTH_COOKIE);
    for (const char *at = cookies; *at; at += strspn(at, "; ")) {
        size_t length = strcspn(at, ";");
        if (length > name && at[name] == '=' && memcmp(at, AUTH_COOKIE, name) == 0) {
            snprintf(token, TOKEN_SIZE, "%.*s", (int)(length - name - 1), at + name + 1);
            return true;
        }
        at += length;
    }
    return false;
}

bool auth_bearer(const struct request *r, char token[TOKEN_SIZE]) {
    const char *authorization = request_field(r, "Authorization");
    if (!authorization || strncasecmp(authorization, "Bearer ", 7) != 0)
        return false;
    snprintf(token, TOKEN_SIZE, "%s", authorization + 7 + strspn(authorization + 7, " "));
    return true;
}

/* The token that the caller presents; false where there is none, or another scheme. */
static bool read_token(const struct request *r, char token[TOKEN_SIZE]) {
    if (auth_bearer(r, token))
        return true;
    const char *cookies = request_field(r, "Cookie");
    return cookies && read_cookie(cookies, token);
}

/* 401, with a detail that says how to authenticate. */
static struct response *refuse(const struct request *r, const char *detail) {
    const char *hint = r->route->access == ROUTE_NODE
                           ? "an attempt has a token of its own, which was given to the job script that runs it"
                           : "`unbaked token add NAME` on the server makes a token, `unbake login` keeps it";
    struct response *reply = problem_full(r, 401, detail, hint, NULL);
    response_field(reply, "WWW-Authenticate", "Bearer realm=\"unbaked\"");
    return reply;
}

static void log_failure(const struct request *r, const char *why, const char *more) {
    char address[ADDRESS_TEXT_SIZE];
    address_text(&r->address, address);
    const struct log_field fields[] = {
        {"request", r->id, false}, {"client", address, false}, {"path", r->target.path, false}};
    log_fields(LOG_INFO, fields, sizeof fields / sizeof *fields, "login failed: %s%s", why, more);
}

/* Whoever has an expired token does not guess: he is told, and not throttled. */
static struct response *refuse_expired(const struct request *r, const struct error *err) {
    cJSON *members = cJSON_CreateObject();
    log_failure(r, err->message, "");
    json_add_string(members, "type", AUTH_EXPIRED);
    json_add_string(members, "title", "Token expired");
    struct response *reply = problem_full(r, 401, err->message, err->hint, members);
    response_field(reply, "WWW-Authenticate", "Bearer realm=\"unbaked\", error=\"invalid_token\"");
    return reply;
}

struct response *auth_reject(struct api *api, struct request *r, const struct error *err) {
    bool is_first;
    if (err && err->status == STATUS_CONFLICT)
        return refuse_expired(r, err);
    double wait_sec = auth_throttle_fail(api->auth_throttle, &r->address, clock_sec(), &is_first);
    if (wait_sec <= 0.0 || is_first)
        log_failure(r, "the token is not valid",
                    is_first ? "; more of them from this address are refused with 429 and not logged" : "");
    if (wait_sec <= 0.0)
        return refuse(r, "the token is invalid or was revoked");
    cJSON *members = cJSON_CreateObject();
    json_add_string(members, "type", "urn:unbake:too-many-tokens");
    json_add_string(members, "title", "Too many invalid tokens");
    struct response *reply = problem_full(r, 429, "too many invalid tokens came from this address",
                                          "a valid token is accepted at any time", members);
    response_field(reply, "Retry-After", "%.0f", ceil(wait_sec));
    reply->must_close = true; /* another try must cost a new connection */
    r->is_throttled = true;
    return reply;
}

struct response *auth_check(struct api *api, struct request *r) {
    char token[TOKEN_SIZE];
    struct error err;
    bool has_token = read_token(r, token), is_open = auth_is_open(api);
    r->caller = (struct caller){.role = is_open ? ROLE_ADMIN : ROLE_VIEWER};
    if (r->route->access == ROUTE_NODE) /* node.h asks for the attempt's own token */
        r->caller = (struct caller){.role = ROLE_VIEWER};
    if (r->route->access == ROUTE_PUBLIC || r->route->access == ROUTE_NODE)
        return NULL;
    enum status status = STATUS_OK;
    if (has_token)
        status = store_token_find(api->store, token, &r->caller, &err);
    bool is_wrong = status == STATUS_NOT_FOUND || status == STATUS_CONFLICT;
    if (is_wrong && is_open)
        r->caller = (struct caller){.role = ROLE_ADMIN}; /* a cookie of another daemon, or an old one */
    else if (is_wrong)
        return auth_reject(api, r, &err);
    else if (status != STATUS_OK)
        return problem_from(r, &err);
    else if (!has_token && !is_open)
        return refuse(r, "this daemon asks for a token");
    if (r->caller.role >= r->route->access - ROUTE_VIEWER)
        return NULL;
    if (r->route->access == ROUTE_ADMIN)
        return problem(r, 403, "only an admin may do that");
    return problem(r, 403, "a token of role \"%s\" may only read", role_name(r->caller.role));
}

/* --- things ------------------------------------------------------------------------------ */

static struct response *may_only_look(const struct request *r) {
    return problem(r, 403, "it is shared with you for reading; its owner can change it");
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
    *refusal = access == ACCESS_NONE ? problem(r, 404, "there is no job %lld", (long long)id) : may_only_look(r);
    return false;
}

int64_t auth_job_id(struct api *api, const struct request *r, enum access needed, struct response **refusal) {
    struct job job;
    if (!auth_job(api, r, needed, &job, refusal))
        return 0;
    int64_t id = job.id;
    job_release(&job);
    return id;
}

enum status auth_find_scene(struct api *api, const struct request *r, const char *id, struct scene_row *row,
                            struct error *err) {
    return store_scene_find(api->store, &r->caller, id, row, err);
}

bool auth_scene(struct api *api, const struct request *r, enum access needed, struct scene_row *row,
                struct response **refusal) {
    const char *id = r->target.segments[2];
    size_t digits = strspn(id, "0123456789abcdef");
    struct error err;
    enum access access = ACCESS_NONE;
    if (digits < 8 || digits > 64 || id[digits] != '\0') {
        *refusal = problem(r, 404, "\"%.80s\" is not a scene's id: 8 to 64 lower-case hex digits", id);
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
