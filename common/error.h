/* error.h -- how functions that can fail report it: a status code and a sentence.
 *
 * A function that can fail returns `enum status` and takes `struct error *err` last. The
 * caller owns the struct, usually on its stack, and may pass NULL when it needs no sentence.
 * Whoever can act on an error translates it once; nobody logs and returns the same one. */
#ifndef UNBAKE_COMMON_ERROR_H
#define UNBAKE_COMMON_ERROR_H

#include <stdarg.h>

enum status {
    STATUS_OK = 0,
    STATUS_INPUT,       /* what the user gave is at fault; trying again will not help */
    STATUS_IO,          /* the operating system refused or a device failed */
    STATUS_NO_SPACE,    /* the disk or a quota is full */
    STATUS_NOT_FOUND,   /* the named thing does not exist */
    STATUS_CONFLICT,    /* the thing's state forbids the action */
    STATUS_LIMIT,       /* a configured limit would be exceeded */
    STATUS_UNAVAILABLE, /* cannot be reached now; may work later */
    STATUS_CANCELLED,   /* asked to stop */
    STATUS_CORRUPT,     /* our own stored data fails its checks */
    STATUS_INTERNAL,    /* a defect in this program */
    STATUS_COUNT
};

struct error {
    enum status status;
    char message[1024]; /* names the thing, the place, what was expected and what was found */
    char hint[256];     /* what the user can do about it; may be empty */
};

/* Fills *err (if not NULL; its hint is emptied) and returns `status`. */
enum status error_set(struct error *err, enum status status, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* As error_set, with ": " and the text of the errno value `number` appended; maps ENOSPC and
 * EDQUOT to STATUS_NO_SPACE, ENOENT to STATUS_NOT_FOUND and everything else to STATUS_IO. */
enum status error_set_errno(struct error *err, int number, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* Puts "prefix: " before the message already in *err; returns its status. */
enum status error_prefix(struct error *err, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* Sets the hint of an error that was just set; returns its status. */
enum status error_hint(struct error *err, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* A stable lower-case word for a status: "input", "no-space", ... Never NULL. */
const char *status_name(enum status status);

#endif
