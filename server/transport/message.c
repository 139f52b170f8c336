/* message.c -- see message.h. */
#include "server/transport/message.h"

#include <assert.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

#include "common/mem.h"
#include "common/protocol.h"

void request_release(struct request *r) {
    target_release(&r->target);
    for (size_t i = 0; i < r->field_count; i++) {
        mem_free(r->fields[i].name);
        mem_free(r->fields[i].value);
    }
    mem_free(r->fields);
    buf_release(&r->body);
}

const char *request_field(const struct request *r, const char *name) {
    for (size_t i = 0; i < r->field_count; i++)
        if (strcasecmp(r->fields[i].name, name) == 0)
            return r->fields[i].value;
    return NULL;
}

struct response *response_new(int status) {
    struct response *r = mem_calloc(1, sizeof *r);
    r->status = status;
    r->fd = -1;
    return r;
}

void response_free(struct response *r) {
    if (!r)
        return;
    for (size_t i = 0; i < r->field_count; i++) {
        mem_free(r->fields[i].name);
        mem_free(r->fields[i].value);
    }
    if (!r->text_is_static)
        mem_free(r->text);
    if (r->fd >= 0)
        close(r->fd);
    if (r->stream)
        r->stream->close(r->stream);
    mem_free(r);
}

void response_field(struct response *r, const char *name, const char *format, ...) {
    char value[1024];
    size_t i = 0;
    va_list args;
    va_start(args, format);
    vsnprintf(value, sizeof value, format, args);
    va_end(args);
    while (i < r->field_count && strcmp(r->fields[i].name, name) != 0)
        i++;
    assert(i < RESPONSE_FIELDS_MAX);
    if (i == r->field_count)
        r->fields[r->field_count++].name = mem_strdup(name);
    mem_free(r->fields[i].value);
    r->fields[i].value = mem_strdup(value);
}

struct response *response_text(int status, const char *content_type, char *text, size_t length) {
    struct response *r = response_new(status);
    response_field(r, "Content-Type", "%s", content_type);
    r->text = text;
    r->length = length;
    return r;
}

struct response *response_json(int status, cJSON *value) {
    char *text = json_text(value);
    cJSON_Delete(value);
    size_t length = strlen(text);
    char *line = mem_printf("%s\n", text); /* end with a newline, for terminals */
    mem_free(text);
    struct response *r = response_text(status, MIME_JSON, line, length + 1);
    response_field(r, "Cache-Control", "no-cache");
    return r;
}

struct response *response_static(const char *content_type, const void *text, size_t length) {
    struct response *r = response_new(200);
    response_field(r, "Content-Type", "%s", content_type);
    /* The text is only read; the member is not const because other responses own theirs. */
    memcpy(&r->text, &text, sizeof text);
    r->text_is_static = true;
    r->length = length;
    return r;
}
