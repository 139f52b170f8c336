/* log.c -- see log.h. */
#include "common/log.h"

#include <assert.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "common/clock.h"
#include "common/utf8.h"

/* Message and values are truncated before quoting, so that a line is always complete. */
#define MESSAGE_BYTES 1500
#define VALUE_BYTES 256 /* of the value of a field; what is longer is cut off */
#define CLEAN_FACTOR 4  /* utf8_show */
#define LINE_BYTES (CLEAN_FACTOR * MESSAGE_BYTES + LOG_FIELDS_MAX * (CLEAN_FACTOR * VALUE_BYTES + 40) + 200)

static atomic_int current_level = LOG_INFO, current_format = LOG_TEXT;

static const char *const level_names[] = {"error", "warning", "info", "debug"};
static const char *const format_names[] = {"text", "logfmt", "json"};

void log_set_level(enum log_level level) { atomic_store(&current_level, (int)level); }

void log_set_format(enum log_format format) { atomic_store(&current_format, (int)format); }

bool log_level_parse(const char *name, enum log_level *level) {
    for (int i = LOG_ERROR; i <= LOG_DEBUG; i++) {
        if (strcmp(name, level_names[i]) == 0) {
            *level = (enum log_level)i;
            return true;
        }
    }
    return false;
}

bool log_format_parse(const char *name, enum log_format *format) {
    for (int i = LOG_TEXT; i <= LOG_JSON; i++) {
        if (strcmp(name, format_names[i]) == 0) {
            *format = (enum log_format)i;
            return true;
        }
    }
    return false;
}

struct line {
    char text[LINE_BYTES];
    size_t length;
};

static void put(struct line *line, const char *text, size_t length) {
    assert(line->length + length <= LINE_BYTES);
    memcpy(line->text + line->length, text, length);
    line->length += length;
}

static void put_text(struct line *line, const char *text) { put(line, text, strlen(text)); }

/* The text as utf8_show has it; `quoted`: with \ before " and \ */
static void put_clean(struct line *line, const char *text, bool quoted) {
    char shown[UTF8_SHOWN_SIZE];
    for (size_t left = strlen(text), size; left > 0; text += size, left -= size) {
        size = utf8_show(text, left, shown);
        if (quoted && (*shown == '"' || *shown == '\\'))
            put(line, "\\", 1);
        put_text(line, shown);
    }
}

static void put_quoted(struct line *line, const char *text) {
    put(line, "\"", 1);
    put_clean(line, text, true);
    put(line, "\"", 1);
}

/* key=value, with quotes where the value needs them. */
static void put_pair(struct line *line, const char *key, const char *value) {
    put(line, " ", 1);
    put_text(line, key);
    put(line, "=", 1);
    if (*value && strcspn(value, " =\"\\") == strlen(value))
        put_clean(line, value, false);
    else
        put_quoted(line, value);
}

static void put_member(struct line *line, const char *key, const char *value, bool is_number) {
    put(line, ",\"", 2);
    put_text(line, key);
    put(line, "\":", 2);
    if (is_number)
        put_text(line, value);
    else
        put_quoted(line, value);
}

static void write_line(enum log_level level, const struct log_field *fields, size_t count, const char *format,
                       va_list args) {
    if ((int)level > atomic_load(&current_level))
        return;
    enum log_format style = (enum log_format)atomic_load(&current_format);
    struct line line = {.length = 0};
    char message[MESSAGE_BYTES], value[VALUE_BYTES], at[CLOCK_TEXT_SIZE];
    clock_text(clock_unix_ms(), at);
    vsnprintf(message, sizeof message, format, args);
    put_text(&line, style == LOG_TEXT ? "" : style == LOG_JSON ? "{\"time\":\"" : "time=");
    put_text(&line, at);
    if (style == LOG_TEXT) {
        put(&line, " ", 1);
        put_text(&line, level_names[level]);
        put(&line, ": ", 2);
        put_clean(&line, message, false);
    } else if (style == LOG_LOGFMT) {
        put_pair(&line, "level", level_names[level]);
        put(&line, " msg=", 5);
        put_quoted(&line, message);
    } else {
        put(&line, "\"", 1);
        put_member(&line, "level", level_names[level], false);
        put_member(&line, "msg", message, false);
    }
    assert(count <= LOG_FIELDS_MAX);
    for (size_t i = 0; i < count; i++) {
        if (!fields[i].value)
            continue;
        snprintf(value, sizeof value, "%s", fields[i].value);
        if (style == LOG_JSON)
            put_member(&line, fields[i].key, value, fields[i].is_number);
        else
            put_pair(&line, fields[i].key, value);
    }
    put_text(&line, style == LOG_JSON ? "}\n" : "\n");
    /* Nothing sensible can be done when stderr itself fails. */
    if (write(STDERR_FILENO, line.text, line.length) < 0)
        return;
}

void log_fields(enum log_level level, const struct log_field *fields, size_t count, const char *format, ...) {
    va_list args;
    va_start(args, format);
    write_line(level, fields, count, format, args);
    va_end(args);
}

#define DEFINE_LOG(name, level)                                                                                        \
    void name(const char *format, ...) {                                                                               \
        va_list args;                                                                                                  \
        va_start(args, format);                                                                                        \
        write_line(level, NULL, 0, format, args);                                                                      \
        va_end(args);                                                                                                  \
    }

DEFINE_LOG(log_error, LOG_ERROR)
DEFINE_LOG(log_warning, LOG_WARNING)
DEFINE_LOG(log_info, LOG_INFO)
DEFINE_LOG(log_debug, LOG_DEBUG)
