/* ply_values.c -- see ply_values.h. */
#include "server/ingest/mesh/ply_values.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define MAX_TOKEN 64 /* characters of a number */
#define MISSING "has fewer values than the header says"

enum status ply_value_error(struct ply_values *r, const char *what) {
    bool ascii = r->header.format == PLY_ASCII;
    return error_set(r->err, STATUS_INPUT, "%s, %s %zu: %s %" PRIu64 " %s", r->cursor.name, ascii ? "line" : "byte",
                     ascii ? (r->is_wrapped ? r->first_line : r->cursor.line) : r->cursor.at, r->element, r->record,
                     what);
}

static uint64_t load(const uint8_t *at, size_t bytes, bool big) {
    uint64_t bits = 0;
    for (size_t i = 0; i < bytes; i++)
        bits |= (uint64_t)at[big ? bytes - 1 - i : i] << (8 * i);
    return bits;
}

static enum status read_binary(struct ply_values *r, enum ply_type type, double *value) {
    size_t bytes = ply_type_bytes(type);
    if (r->cursor.size - r->cursor.at < bytes)
        return ply_value_error(r, "is cut off: the file ends there");
    uint64_t bits = load(r->cursor.data + r->cursor.at, bytes, r->header.format == PLY_BIG_ENDIAN);
    r->cursor.at += bytes;
    float single;
    uint32_t low = (uint32_t)bits;
    switch (type) {
    case PLY_INT8: *value = (int8_t)bits; break;
    case PLY_INT16: *value = (int16_t)bits; break;
    case PLY_INT32: *value = (int32_t)low; break;
    case PLY_UINT8:
    case PLY_UINT16:
    case PLY_UINT32: *value = low; break;
    case PLY_FLOAT32:
        memcpy(&single, &low, sizeof single);
        *value = (double)single;
        break;
    case PLY_FLOAT64: memcpy(value, &bits, sizeof *value); break;
    }
    return STATUS_OK;
}

static bool is_blank(uint8_t c) { return c == ' ' || c == '\t' || c == '\r'; }

static void skip_blanks(struct ply_values *r) {
    while (r->cursor.at < r->cursor.line_end && is_blank(r->cursor.data[r->cursor.at]))
        r->cursor.at++;
}

static void leave_line(struct ply_values *r) {
    r->cursor.at = r->cursor.line_end < r->cursor.size ? r->cursor.line_end + 1 : r->cursor.size;
}

/* From the beginning of a line to the first value of the next line that has one. */
static bool find_filled_line(struct ply_values *r) {
    const uint8_t *line;
    size_t length;
    do {
        if (!ply_next_line(&r->cursor, &line, &length))
            return false;
        r->cursor.at = (size_t)(line - r->cursor.data);
        skip_blanks(r);
        if (r->cursor.at < r->cursor.line_end)
            return true;
        leave_line(r);
    } while (true);
}

static bool next_filled_line(struct ply_values *r) {
    leave_line(r);
    return find_filled_line(r);
}

static enum status read_ascii(struct ply_values *r, double *value) {
    skip_blanks(r);
    if (r->cursor.at >= r->cursor.line_end) {
        r->is_wrapped = true;
        if (!next_filled_line(r))
            return ply_value_error(r, MISSING);
    }
    char token[MAX_TOKEN];
    size_t length = 0;
    while (r->cursor.at < r->cursor.line_end && !is_blank(r->cursor.data[r->cursor.at])) {
        if (length + 1 == sizeof token)
            return ply_value_error(r, "has a value that is not a number");
        token[length++] = (char)r->cursor.data[r->cursor.at++];
    }
    token[length] = '\0';
    char *end;
    *value = strtod(token, &end);
    if (end != token + length || strpbrk(token, "xX("))
        return ply_value_error(r, "has a value that is not a number");
    return STATUS_OK;
}

enum status ply_read_value(struct ply_values *r, enum ply_type type, double *value) {
    return r->header.format == PLY_ASCII ? read_ascii(r, value) : read_binary(r, type, value);
}

enum status ply_read_list_count(struct ply_values *r, const struct ply_property *p, uint64_t *count) {
    double value;
    enum status status = ply_read_value(r, p->count_type, &value);
    if (status != STATUS_OK)
        return status;
    if (!(value >= 0.0 && value <= UINT32_MAX) || value != floor(value))
        return ply_value_error(r, "has a list of impossible length");
    *count = (uint64_t)value;
    return STATUS_OK;
}

enum status ply_skip_property(struct ply_values *r, const struct ply_property *p) {
    uint64_t count = 1;
    double ignored;
    if (p->is_list) {
        enum status status = ply_read_list_count(r, p, &count);
        if (status != STATUS_OK)
            return status;
    }
    if (r->header.format != PLY_ASCII) {
        if ((r->cursor.size - r->cursor.at) / ply_type_bytes(p->type) < count)
            return ply_value_error(r, "is cut off: the file ends there");
        r->cursor.at += (size_t)count * ply_type_bytes(p->type);
        return STATUS_OK;
    }
    for (uint64_t i = 0; i < count; i++) {
        enum status status = read_ascii(r, &ignored);
        if (status != STATUS_OK)
            return status;
    }
    return STATUS_OK;
}

enum status ply_end_body(struct ply_values *r) {
    skip_blanks(r);
    bool has_more = r->is_stream && (r->cursor.at < r->cursor.line_end || next_filled_line(r));
    return has_more ? ply_value_error(r, "is the last, but values follow") : STATUS_OK;
}

enum status ply_begin_record(struct ply_values *r, uint64_t record) {
    r->record = record;
    r->is_wrapped = false;
    if (r->header.format != PLY_ASCII)
        return STATUS_OK;
    skip_blanks(r);
    bool is_within = r->is_stream && r->cursor.at < r->cursor.line_end;
    bool found = is_within || (r->is_stream ? next_filled_line(r) : find_filled_line(r));
    r->first_line = r->cursor.line;
    return found ? STATUS_OK : ply_value_error(r, "is missing: the file ends there");
}

enum status ply_end_record(struct ply_values *r) {
    if (r->header.format != PLY_ASCII)
        return STATUS_OK;
    skip_blanks(r);
    bool has_more = r->cursor.at < r->cursor.line_end;
    r->has_extra = r->has_extra || has_more;
    if (r->is_stream && has_more)
        return STATUS_OK;
    if (!r->is_stream && r->is_wrapped && r->cursor.at < r->cursor.line_end)
        return ply_value_error(r, MISSING);
    leave_line(r);
    return STATUS_OK;
}

enum status ply_begin_element(struct ply_values *r, const struct ply_element *e) {
    r->element = e->name;
    uint64_t least = 0;
    for (size_t i = 0; i < e->property_count; i++) {
        const struct ply_property *p = &r->header.property[e->first + i];
        /* A character and a separator per ASCII value; an empty list still has its length. */
        enum ply_type first = p->is_list ? p->count_type : p->type;
        least += r->header.format == PLY_ASCII ? 2 : ply_type_bytes(first);
    }
    uint64_t rest = r->cursor.size - r->cursor.at + 1; /* the last line may lack its newline */
    if (least > 0 && e->count > rest / least)
        return error_set(r->err, STATUS_INPUT,
                         "%s: the header promises %" PRIu64 " of element %s, but the %" PRIu64
                         " bytes that are left hold at most %" PRIu64,
                         r->cursor.name, e->count, e->name, rest - 1, rest / least);
    return STATUS_OK;
}
