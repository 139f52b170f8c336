/* log.h -- one line to stderr per event, with a UTC time and a level.
 *
 *   text     2026-01-02T03:04:05.678Z info: request request=1f2e method=GET status=200
 *   logfmt   time=2026-01-02T03:04:05.678Z level=info msg="request" request=1f2e method=GET status=200
 *   json     {"time":"2026-01-02T03:04:05.678Z","level":"info","msg":"request","request":"1f2e",...}
 *
 * Thread-safe (a line is one write). The level and the format are the program's only mutable
 * globals. What a user sent cannot forge a line or how it reads: control characters are
 * replaced, invisible ones and those that change directions spelled out (utf8_show), quotes escaped. */
#ifndef UNBAKE_COMMON_LOG_H
#define UNBAKE_COMMON_LOG_H

#include <stdbool.h>
#include <stddef.h>

enum log_level { LOG_ERROR, LOG_WARNING, LOG_INFO, LOG_DEBUG };
enum log_format { LOG_TEXT, LOG_LOGFMT, LOG_JSON };

void log_set_level(enum log_level level);
void log_set_format(enum log_format format);
/* Reads "error", "warning", "info" or "debug"; false for anything else. */
bool log_level_parse(const char *name, enum log_level *level);
/* Reads "text", "logfmt" or "json". */
bool log_format_parse(const char *name, enum log_format *format);

void log_error(const char *format, ...) __attribute__((format(printf, 1, 2)));
void log_warning(const char *format, ...) __attribute__((format(printf, 1, 2)));
void log_info(const char *format, ...) __attribute__((format(printf, 1, 2)));
void log_debug(const char *format, ...) __attribute__((format(printf, 1, 2)));

#define LOG_FIELDS_MAX 10 /* of one line */
/* A figure or name to search for, in addition to the message. Fields without a value are left out. */
struct log_field {
    const char *key;   /* letters and _, at most 30 */
    const char *value; /* UTF-8; NULL: none */
    bool is_number;    /* written without quotes in JSON */
};
void log_fields(enum log_level level, const struct log_field *fields, size_t count, const char *format, ...)
    __attribute__((format(printf, 4, 5)));

#endif
