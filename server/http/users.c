/* users.c -- /v1/users and /v1/tokens, for admins: who there is, what they keep and have used, and their tokens.
 *
 * 1. A token's secret is in the reply that makes it, and nowhere else.
 * 2. A token that is made here ends no later than the token of the admin who makes it.
 * 3. While the daemon is open there is nobody who could answer for a token: the first is made on the server. */
#include <string.h>

#include "common/clock.h"
#include "common/log.h"
#include "common/mem.h"
#include "server/events/hub.h"
#include "server/http/auth.h"
#include "server/http/handlers.h"
#include "server/http/views.h"
#include "server/net/field.h"
#include "server/transport/body.h"
#include "server/transport/problem.h"

/* --- users ------------------------------------------------------------------------------------ */

static void add_usage(cJSON *item, const char *name, const struct usage_row *usage, size_t count) {
    double sum = 0.0, last = 0.0;
    const char *month = count > 0 ? usage[count - 1].month : ""; /* the latest in which anybody used something */
    for (size_t i = 0; i < count; i++) {
        double sec = strcmp(usage[i].user, name) == 0 ? usage[i].cpu_sec : 0.0;
        sum += sec;
        last += strcmp(usage[i].month, month) == 0 ? sec : 0.0;
    }
    json_add_number(item, "cpu_sec", sum);
    json_add_number(item, "cpu_sec_month", last);
    json_add_string(item, "month", *month ? month : NULL);
}

static enum status view_user(const struct api *api, const struct user_row *user, cJSON *item, struct error *err) {
    uint64_t kept = 0;
    enum status status = store_user_bytes(api->store, user->id, NULL, 0, &kept, err);
    json_add_string(item, "name", user->name);
    view_add_time(item, "created_at", user->created_ms);
    json_add_int(item, "jobs", user->jobs);
    json_add_int(item, "open_jobs", user->open_jobs);
    json_add_int(item, "kept_bytes", (int64_t)kept);
    if (api->config.user_max_bytes > 0)
        json_add_int(item, "kept_bytes_max", (int64_t)api->config.user_max_bytes);
    else
        json_add(item, "kept_bytes_max", cJSON_CreateNull());
    return status;
}

struct response *users_list(struct api *api, struct request *r) {
    struct user_row *users = NULL;
    struct usage_row *usage = NULL;
    size_t user_count = 0, usage_count = 0;
    struct error err;
    cJSON *value = cJSON_CreateObject(), *items = cJSON_AddArrayToObject(value, "items");
    enum status status = store_user_list(api->store, &users, &user_count, &err);
    if (status == STATUS_OK)
        status = store_usage_list(api->store, &usage, &usage_count, &err);
    for (size_t i = 0; i < user_count && status == STATUS_OK; i++) {
        cJSON *item = cJSON_CreateObject();
        status = view_user(api, &users[i], item, &err);
        add_usage(item, users[i].name, usage, usage_count);
        cJSON_AddItemToArray(items, item);
    }
    store_usage_release(usage, usage_count);
    mem_free(users);
    if (status == STATUS_OK)
        return response_json(200, value);
    cJSON_Delete(value);
    return problem_from(r, &err);
}

/* --- tokens ----------------------------------------------------------------------------------- */

static cJSON *view_token(int64_t id, const char *user, enum role role, int64_t created_ms, int64_t expires_ms) {
    cJSON *item = cJSON_CreateObject();
    json_add_int(item, "id", id);
    json_add_string(item, "user", user);
    json_add_string(item, "role", role_name(role));
    view_add_time(item, "created_at", created_ms);
    view_add_time(item, "expires_at", expires_ms);
    json_add_bool(item, "expired", expires_ms != 0 && expires_ms <= clock_unix_ms());
    return item;
}

struct response *tokens_list(struct api *api, struct request *r) {
    struct token_row *rows = NULL;
    size_t count = 0;
    struct error err;
    if (store_token_list(api->store, &rows, &count, &err) != STATUS_OK)
        return problem_from(r, &err);
    cJSON *value = cJSON_CreateObject(), *items = cJSON_AddArrayToObject(value, "items");
    for (size_t i = 0; i < count; i++)
        cJSON_AddItemToArray(
            items, view_token(rows[i].id, rows[i].name, rows[i].role, rows[i].created_ms, rows[i].expires_ms));
    mem_free(rows);
    return response_json(200, value);
}

struct token_request {
    const char *user;
    enum role role;
    int64_t expires_ms;
};

static void read_expiry(struct token_request *t, const cJSON *member, cJSON *params) {
    t->expires_ms = cJSON_IsString(member) ? clock_read(member->valuestring) : 0;
    if (t->expires_ms == 0 && !cJSON_IsNull(member))
        problem_param(params, "expires_at", "null: never", "must be a time in UTC, like 2030-01-31T12:00:00Z, or null");
    else if (t->expires_ms != 0 && t->expires_ms <= clock_unix_ms())
        problem_param(params, "expires_at", NULL, "is past");
}

static void read_member(struct token_request *t, const cJSON *member, cJSON *params) {
    const char *name = member->string, *text = cJSON_GetStringValue(member);
    if (strcmp(name, "user") == 0 && text)
        t->user = text;
    else if (strcmp(name, "user") == 0)
        problem_param(params, name, NULL, "must be text");
    else if (strcmp(name, "role") == 0 && !(text && role_parse(text, &t->role)))
        problem_param(params, name, NULL, "must be viewer, user or admin");
    else if (strcmp(name, "expires_at") == 0)
        read_expiry(t, member, params);
    else if (strcmp(name, "role") != 0)
        problem_param(params, name, "known: user, role, expires_at", "is unknown");
}

static struct response *outlives(const struct request *r) {
    char when[CLOCK_TEXT_SIZE];
    clock_text(r->caller.expires_ms, when);
    return problem(r, 403, "your own token expires at %s: one that it makes must not last longer", when);
}

static struct response *add_token(struct api *api, const struct request *r, const struct token_request *t) {
    char token[TOKEN_SIZE];
    int64_t id;
    struct error err;
    int64_t own_ms = r->caller.expires_ms;
    if (own_ms != 0 && (t->expires_ms == 0 || t->expires_ms > own_ms))
        return outlives(r);
    if (store_token_add(api->store, t->user, t->role, t->expires_ms, token, &id, &err) != STATUS_OK)
        return err.status == STATUS_INPUT ? problem_full(r, 422, err.message, err.hint, NULL) : problem_from(r, &err);
    log_info("token %lld made for %s, role %s, by %s", (long long)id, t->user, role_name(t->role), r->caller.name);
    cJSON *value = view_token(id, t->user, t->role, clock_unix_ms(), t->expires_ms);
    json_add_string(value, "token", token);
    struct response *reply = response_json(201, value);
    response_field(reply, "Location", "/v1/tokens/%lld", (long long)id);
    response_field(reply, "Cache-Control", "no-store");
    return reply;
}

struct response *tokens_add(struct api *api, struct request *r) {
    struct response *reply = NULL;
    if (auth_is_open(api))
        return problem_full(r, 409, "the daemon lets everybody in: its first token is made on the server",
                            "`unbaked token add NAME --role admin`", NULL);
    cJSON *body = body_object(r, &reply);
    if (!body)
        return reply;
    struct token_request wanted = {.role = ROLE_USER};
    cJSON *params = cJSON_CreateArray();
    for (const cJSON *member = body->child; member; member = member->next)
        read_member(&wanted, member, params);
    if (!wanted.user && !cJSON_HasObjectItem(body, "user"))
        problem_param(params, "user", NULL, "is missing");
    if (cJSON_GetArraySize(params) > 0) {
        reply = problem_invalid(r, "the token is invalid", params);
        params = NULL;
    } else {
        reply = add_token(api, r, &wanted);
    }
    cJSON_Delete(params);
    cJSON_Delete(body);
    return reply;
}

struct response *tokens_delete(struct api *api, struct request *r) {
    const char *number = r->target.segments[2];
    int64_t id;
    size_t count;
    struct error err;
    if (!field_number(number, 1, INT64_MAX, &id))
        return problem(r, 404, "\"%.80s\" is no token's number", number);
    if (store_token_revoke(api->store, number, &count, &err) != STATUS_OK)
        return problem_from(r, &err);
    log_info("token %s revoked by %s", number, *r->caller.name ? r->caller.name : "nobody");
    hub_recheck(api->hub);
    return response_new(204);
}
