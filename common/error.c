/* error.c -- see error.h. */
#include "common/error.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

static void fill(struct error *err, enum status status, const char *format, va_list args) {
    err->status = status;
    err->hint[0] = '\0';
    vsnprintf(err->message, sizeof err->message, format, args);
}

enum status error_set(struct error *err, enum status status, const char *format, ...) {
    if (err) {
        va_list args;
        va_start(args, format);
        fill(err, status, format, args);
        va_end(args);
    }
    return status;
}

enum status error_set_errno(struct error *err, int number, const char *format, ...) {
    enum status status = number == ENOSPC || number == EDQUOT ? STATUS_NO_SPACE
                         : number == ENOENT                   ? STATUS_NOT_FOUND
                                                              : STATUS_IO;
    if (err) {
        va_list args;
        va_start(args, format);
        fill(err, status, format, args);
        va_end(args);
        size_t used = strlen(err->message);
        char text[128];
        /* The GNU strerror_r: may or may not use the buffer. */
        snprintf(err->message + used, sizeof err->message - used, ": %s", strerror_r(number, text, sizeof text));
    }
    return status;
}

enum status error_prefix(struct error *err, const char *format, ...) {
    if (!err)
        return STATUS_INTERNAL;
    char old[sizeof err->message];
    memcpy(old, err->message, sizeof old);
    va_list args;
    va_start(args, format);
    int used = vsnprintf(err->message, sizeof err->message, format, args);
    va_end(args);
    if (used >= 0 && (size_t)used < sizeof err->message)
        snprintf(err->message + used, sizeof err->message - (size_t)used, ": %.*s",
                 (int)(sizeof err->message - (size_t)used), old);
    return err->status;
}

enum status error_hint(struct error *err, const char *format, ...) {
    if (!err)
        return STATUS_INTERNAL;
    va_list args;
    va_start(args, format);
    vsnprintf(err->hint, sizeof err->hint, format, args);
    va_end(args);
    return err->status;
}

const char *status_name(enum status status) {
    static const char *const names[STATUS_COUNT] = {
        [STATUS_OK] = "ok",
        [STATUS_INPUT] = "input",
        [STATUS_IO] = "io",
        [STATUS_NO_SPACE] = "no-space",
        [STATUS_NOT_FOUND] = "not-found",
        [STATUS_CONFLICT] = "conflict",
        [STATUS_LIMIT] = "limit",
        [STATUS_UNAVAILABLE] = "unavailable",
        [STATUS_CANCELLED] = "cancelled",
        [STATUS_CORRUPT] = "corrupt",
        [STATUS_INTERNAL] = "internal",
    };
    return (unsigned)status < STATUS_COUNT ? names[status] : "unknown";
}
