/* frame_context.c -- see frame_context.h. */
#include "server/ingest/frame_context.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void frame_context_problem(struct frame_context *c, const char *format, ...) {
    char what[1024]; /* longer messages are truncated */
    va_list args;
    va_start(args, format);
    vsnprintf(what, sizeof what, format, args);
    va_end(args);
    findings_problem(c->findings, c->name, "%s: %s", c->place, what);
    c->ok = false;
}

/* The object that has the value: the frame or the file; NULL when neither does. Faults at the top level are reported
 * once, by read_top. */
const cJSON *frame_context_holder(const struct frame_context *c, const char *key) {
    const cJSON *own = c->frame ? cJSON_GetObjectItemCaseSensitive(c->frame, key) : NULL;
    return own && !cJSON_IsNull(own) ? c->frame : c->root;
}

/* A number, also in quotes, as some scripts write it. */
bool frame_context_plain_number(const cJSON *item, double *value) {
    const char *text = cJSON_GetStringValue(item);
    char *end = NULL;
    if (cJSON_IsNumber(item)) {
        *value = item->valuedouble;
        return true;
    }
    if (!text || text[0] == '\0' || text[strspn(text, "0123456789+-.eE")] != '\0')
        return false;
    *value = strtod(text, &end);
    return *end == '\0' && isfinite(*value);
}

double frame_context_number(struct frame_context *c, const char *key, double fallback) {
    struct error err;
    double value;
    if (frame_context_plain_number(cJSON_GetObjectItemCaseSensitive(frame_context_holder(c, key), key), &value) &&
        isfinite(value))
        return value;
    if (json_number(frame_context_holder(c, key), key, c->place, fallback, &value, &err) != STATUS_OK) {
        findings_error(c->findings, c->name, &err);
        c->ok = false;
        return fallback;
    }
    return value;
}

const char *frame_context_string(struct frame_context *c, const cJSON *object, const char *key) {
    struct error err;
    const char *value;
    if (json_string(object, key, c->place, NULL, &value, &err) != STATUS_OK) {
        findings_error(c->findings, c->name, &err);
        c->ok = false;
        return NULL;
    }
    return value;
}

/* A value that must be positive if present. */
double frame_context_positive(struct frame_context *c, const char *key) {
    double value = frame_context_number(c, key, NAN);
    if (value <= 0.0) {
        frame_context_problem(c, "%s is %.9g, it must be positive", key, value);
        return NAN;
    }
    return value;
}
