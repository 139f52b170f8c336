/* reply.c -- see reply.h. */
#include "common/reply.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

void reply_init(struct reply *reply) {
    *reply = (struct reply){.retry_after_sec = -1.0, .range_first = -1, .upload_offset = -1};
    buf_init(&reply->body, REPLY_BODY_MAX);
}

void reply_release(struct reply *reply) {
    buf_release(&reply->body);
    cJSON_Delete(reply->json);
    reply->json = NULL;
}

/* The value where `line` is the header `name`; NULL otherwise. */
static const char *header_value(const char *line, const char *name) {
    size_t length = strlen(name);
    if (strncasecmp(line, name, length) != 0 || line[length] != ':')
        return NULL;
    return line + length + 1 + strspn(line + length + 1, " \t");
}

void reply_take_header(struct reply *reply, const char *bytes, size_t length) {
    char line[512];
    snprintf(line, sizeof line, "%.*s", (int)(length < sizeof line ? length : sizeof line - 1), bytes);
    line[strcspn(line, "\r\n")] = '\0';
    if (strncmp(line, "HTTP/", 5) == 0) { /* a new head, possibly after 100 Continue: drop the old one */
        const char *code = strchr(line, ' ');
        reply->code = code ? strtol(code, NULL, 10) : 0;
        reply->content_type[0] = '\0';
        return;
    }
    const char *value = header_value(line, "Content-Type");
    if (value)
        snprintf(reply->content_type, sizeof reply->content_type, "%s", value);
    value = header_value(line, "Retry-After");
    if (value && *value >= '0' && *value <= '9')
        reply->retry_after_sec = strtod(value, NULL);
    value = header_value(line, "Content-Range");
    if (value && strncasecmp(value, "bytes ", 6) == 0 && value[6] >= '0' && value[6] <= '9')
        reply->range_first = strtoll(value + 6, NULL, 10);
    value = header_value(line, "Location");
    if (value && strlen(value) < sizeof reply->location)
        snprintf(reply->location, sizeof reply->location, "%s", value);
    value = header_value(line, "Upload-Offset");
    if (value && *value >= '0' && *value <= '9')
        reply->upload_offset = strtoll(value, NULL, 10);
}

static enum status status_of(long code) {
    switch (code) {
    case 404: return STATUS_NOT_FOUND;
    case 409:
    case 412: return STATUS_CONFLICT;
    case 413:
    case 429: return STATUS_LIMIT;
    case 502:
    case 503:
    case 504: return STATUS_UNAVAILABLE;
    case 507: return STATUS_NO_SPACE;
    default: return code >= 500 ? STATUS_INTERNAL : STATUS_INPUT;
    }
}

enum status reply_judge(struct reply *reply, const char *server, struct error *err) {
    if (strstr(reply->content_type, "json") && reply->body.length > 0) {
        enum status status = json_parse(buf_text(&reply->body), reply->body.length, "the reply", &reply->json, NULL);
        if (status != STATUS_OK) {
            error_set(err, STATUS_UNAVAILABLE, "%s does not answer in JSON", server);
            return error_hint(err, "is that server unbaked?");
        }
    }
    if (reply->code < 400)
        return STATUS_OK;
    const char *detail = NULL, *hint = NULL;
    json_string(reply->json, "detail", "problem", NULL, &detail, NULL);
    json_string(reply->json, "hint", "problem", NULL, &hint, NULL);
    enum status status = status_of(reply->code);
    if (detail)
        error_set(err, status, "%s", detail);
    else
        error_set(err, status, "%s answered %ld", server, reply->code);
    return hint ? error_hint(err, "%s", hint) : status;
}
