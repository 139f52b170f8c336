/* problem.c -- see problem.h. */
#include "server/transport/problem.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "common/log.h"
#include "common/mem.h"
#include "common/protocol.h"

static const struct problem_kind {
    int status;
    const char *word, *title;
} kinds[] = {
    {400, "bad-request", "Malformed request"},
    {401, "unauthorized", "Authentication required"},
    {403, "forbidden", "Not allowed for this caller"},
    {404, "not-found", "Not found"},
    {405, "method-not-allowed", "Method not allowed"},
    {409, "conflict", "Conflict with the current state"},
    {412, "stale", "Precondition failed"},
    {413, "too-large", "Body too large"},
    {415, "media-type", "Unsupported media type"},
    {416, "range", "Range not satisfiable"},
    {417, "expectation", "Expectation failed"},
    {422, "invalid", "Invalid request"},
    {428, "needs-if-match", "If-Match required"},
    {460, "checksum", "Checksum mismatch"},
    {429, "queue-full", "Limit reached"},
    {500, "internal", "Internal error"},
    {503, "unavailable", "Temporarily unavailable"},
    {507, "disk-full", "Insufficient storage"},
};

static const struct problem_kind *kind_of(int status) {
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++)
        if (kinds[i].status == status)
            return &kinds[i];
    return kind_of(500);
}

struct response *problem_full(const struct request *r, int status, const char *detail, const char *hint,
                              cJSON *members) {
    const struct problem_kind *kind = kind_of(status);
    cJSON *body = members ? members : cJSON_CreateObject();
    char type[64];
    snprintf(type, sizeof type, "urn:unbake:%s", kind->word);
    if (!cJSON_HasObjectItem(body, "type")) {
        json_add_string(body, "type", type);
        json_add_string(body, "title", kind->title);
    }
    json_add_int(body, "status", status);
    json_add_string(body, "detail", detail);
    json_add_string(body, "instance", r->target.path ? r->target.path : "");
    json_add_string(body, "request_id", r->id);
    if (hint && *hint)
        json_add_string(body, "hint", hint);
    struct response *reply = response_json(status, body);
    mem_free(reply->fields[0].value);
    reply->fields[0].value = mem_strdup(MIME_PROBLEM);
    if (status == 503 || status == 429)
        response_field(reply, "Retry-After", "%d", status == 429 ? 30 : 2);
    return reply;
}

struct response *problem(const struct request *r, int status, const char *detail_format, ...) {
    char detail[1024];
    va_list args;
    va_start(args, detail_format);
    vsnprintf(detail, sizeof detail, detail_format, args);
    va_end(args);
    return problem_full(r, status, detail, "", NULL);
}

struct response *problem_invalid(const struct request *r, const char *detail, cJSON *params) {
    cJSON *members = cJSON_CreateObject();
    json_add(members, "invalid_params", params);
    return problem_full(r, 422, detail, "", members);
}

void problem_param(cJSON *params, const char *name, const char *hint, const char *reason_format, ...) {
    char reason[512];
    va_list args;
    va_start(args, reason_format);
    vsnprintf(reason, sizeof reason, reason_format, args);
    va_end(args);
    cJSON *param = cJSON_CreateObject();
    json_add_string(param, "name", name);
    json_add_string(param, "reason", reason);
    if (hint)
        json_add_string(param, "hint", hint);
    cJSON_AddItemToArray(params, param);
}

int problem_status(enum status status) {
    switch (status) {
    case STATUS_INPUT: return 422;
    case STATUS_NO_SPACE: return 507;
    case STATUS_NOT_FOUND: return 404;
    case STATUS_CONFLICT: return 409;
    case STATUS_LIMIT: return 429;
    case STATUS_UNAVAILABLE:
    case STATUS_CANCELLED: return 503;
    default: return 500;
    }
}

struct response *problem_from(const struct request *r, const struct error *err) {
    int status = problem_status(err->status);
    if (status == 500) {
        log_fields(LOG_ERROR, &(struct log_field){"request", r->id, false}, 1, "%s", err->message);
        return problem_full(r, 500, "internal error; the server's log has details", "", NULL);
    }
    if (status == 507)
        log_fields(LOG_WARNING, &(struct log_field){"request", r->id, false}, 1, "%s", err->message);
    return problem_full(r, status, err->message, err->hint, NULL);
}
