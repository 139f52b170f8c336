/* colmap_cursor.c -- see colmap_cursor.h. */
#include "server/ingest/source/colmap_cursor.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* --- bytes ---------------------------------------------------------------------------------- */

static bool take(struct colmap_cursor *r, void *to, size_t length) {
    if (r->size - r->at < length)
        return false;
    memcpy(to, r->data + r->at, length);
    r->at += length;
    return true;
}

bool colmap_take_whole(struct colmap_cursor *r, size_t bytes, uint64_t *value) {
    uint8_t raw[8];
    *value = 0;
    if (!take(r, raw, bytes))
        return false;
    for (size_t i = bytes; i-- > 0;)
        *value = *value << 8 | raw[i];
    return true;
}

bool colmap_take_doubles(struct colmap_cursor *r, size_t count, double *value) {
    for (size_t i = 0; i < count; i++) {
        uint64_t bits;
        if (!colmap_take_whole(r, 8, &bits))
            return false;
        memcpy(&value[i], &bits, sizeof bits);
    }
    return true;
}

enum status colmap_cut_off(const struct colmap_cursor *r) {
    return error_set(r->err, STATUS_INPUT, "%s is cut off at byte %zu", r->name, r->at);
}

/* --- lines ---------------------------------------------------------------------------------- */

bool colmap_next_line(struct colmap_cursor *r) {
    bool has_mark = r->size >= 3 && memcmp(r->data, "\xef\xbb\xbf", 3) == 0; /* editors of Windows */
    size_t from = r->line > 0 ? r->line_end + 1 : has_mark ? 3 : 0;
    if (from >= r->size)
        return false;
    const uint8_t *newline = memchr(r->data + from, '\n', r->size - from);
    r->at = from;
    r->line_end = newline ? (size_t)(newline - r->data) : r->size;
    r->line++;
    return true;
}

bool colmap_next_record(struct colmap_cursor *r) {
    while (colmap_next_line(r)) {
        while (r->at < r->line_end && strchr(" \t\r", r->data[r->at]))
            r->at++;
        if (r->at < r->line_end && r->data[r->at] != '#')
            return true;
    }
    return false;
}

bool colmap_next_token(struct colmap_cursor *r, char token[COLMAP_MAX_TOKEN]) {
    size_t length = 0;
    while (r->at < r->line_end && strchr(" \t\r", r->data[r->at]))
        r->at++;
    for (; r->at < r->line_end && !strchr(" \t\r", r->data[r->at]); r->at++)
        if (length + 1 < COLMAP_MAX_TOKEN)
            token[length++] = (char)r->data[r->at];
    token[length] = '\0';
    return length > 0;
}

enum status colmap_line_error(const struct colmap_cursor *r, const char *what) {
    return error_set(r->err, STATUS_INPUT, "%s, line %zu: %s", r->name, r->line, what);
}

enum status colmap_read_doubles(struct colmap_cursor *r, size_t count, double *value) {
    char token[COLMAP_MAX_TOKEN], *end;
    for (size_t i = 0; i < count; i++) {
        if (!colmap_next_token(r, token))
            return colmap_line_error(r, "there are fewer values than there must be");
        value[i] = strtod(token, &end);
        if (*end != '\0')
            return colmap_line_error(r, "there is a value that is not a number");
    }
    return STATUS_OK;
}

enum status colmap_read_id(struct colmap_cursor *r, uint64_t *id) {
    double value;
    enum status status = colmap_read_doubles(r, 1, &value);
    if (status == STATUS_OK && (!(value >= 0.0 && value < UINT32_MAX) || value != floor(value)))
        status = colmap_line_error(r, "there is a number that is no id");
    *id = status == STATUS_OK ? (uint64_t)value : 0;
    return status;
}
