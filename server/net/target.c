/* target.c -- see target.h. */
#include "server/net/target.h"

#include <stdint.h>
#include <string.h>
#include <strings.h>

#include "common/buf.h"
#include "common/mem.h"
#include "common/utf8.h"

static int hex_digit(char c) {
    if (c >= '0' && c <= '9')
        return c - '0';
    if (c >= 'a' && c <= 'f')
        return c - 'a' + 10;
    if (c >= 'A' && c <= 'F')
        return c - 'A' + 10;
    return -1;
}

/* Decodes text[length] into a new string; NULL for a broken escape, a control byte or invalid UTF-8. */
static char *decode(const char *text, size_t length, int plus_is_space) {
    char *out = mem_alloc(length + 1);
    size_t used = 0;
    for (size_t i = 0; i < length; i++) {
        int c = (unsigned char)text[i];
        if (c == '%') {
            int whole = length - i > 2;
            int high = whole ? hex_digit(text[i + 1]) : -1;
            int low = whole ? hex_digit(text[i + 2]) : -1;
            if (high < 0 || low < 0)
                goto bad;
            c = high * 16 + low;
            i += 2;
        } else if (c == '+' && plus_is_space) {
            c = ' ';
        }
        if (c < 0x20 || c == 0x7f)
            goto bad;
        out[used++] = (char)c;
    }
    out[used] = '\0';
    if (utf8_valid(out, used, NULL))
        return out;
bad:
    mem_free(out);
    return NULL;
}

/* True when a part of `text` between slashes is empty, "." or "..". */
static int climbs(const char *text) {
    for (const char *at = text;; at++) {
        size_t length = strcspn(at, "/");
        if (length == 0 || (length == 1 && at[0] == '.') || (length == 2 && memcmp(at, "..", 2) == 0))
            return 1;
        at += length;
        if (*at == '\0')
            return 0;
    }
}

static enum status parse_path(struct target *t, struct error *err) {
    for (const char *at = t->path + 1; *at != '\0';) {
        size_t length = strcspn(at, "/");
        if (t->segment_count == TARGET_SEGMENTS_MAX)
            return error_set(err, STATUS_INPUT, "the path has more than %d parts", TARGET_SEGMENTS_MAX);
        char *segment = decode(at, length, 0);
        if (!segment)
            return error_set(err, STATUS_INPUT,
                             "part %zu of the path has a broken %%-escape, or "
                             "stands for a control byte or no UTF-8",
                             t->segment_count + 1);
        t->segments[t->segment_count++] = segment;
        if (climbs(segment))
            return error_set(err, STATUS_INPUT, "part %zu of the path is empty, \".\" or \"..\"", t->segment_count);
        at += length;
        if (*at == '/' && *++at == '\0')
            return error_set(err, STATUS_INPUT, "the path ends with a slash");
    }
    return STATUS_OK;
}

static enum status parse_query(struct target *t, const char *query, struct error *err) {
    for (const char *at = query; *at != '\0';) {
        size_t length = strcspn(at, "&");
        const char *equals = memchr(at, '=', length);
        size_t name_length = equals ? (size_t)(equals - at) : length;
        if (t->query_count == TARGET_QUERY_MAX)
            return error_set(err, STATUS_INPUT, "the query has more than %d parameters", TARGET_QUERY_MAX);
        char *name = decode(at, name_length, 1);
        char *value = equals ? decode(equals + 1, length - name_length - 1, 1) : mem_strdup("");
        if (!name || !value) {
            mem_free(name);
            mem_free(value);
            return error_set(err, STATUS_INPUT,
                             "query parameter %zu has a broken %%-escape, or "
                             "stands for a control byte or no UTF-8",
                             t->query_count + 1);
        }
        int repeated = target_query(t, name) != NULL;
        t->names[t->query_count] = name;
        t->values[t->query_count++] = value;
        if (repeated)
            return error_set(err, STATUS_INPUT, "query parameter \"%s\" is given twice", name);
        at += length;
        if (*at == '&')
            at++;
    }
    return STATUS_OK;
}

/* Strips scheme and authority from an absolute form ("http://host:80/path"); returns the rest, or raw. */
static const char *take_authority(struct target *t, const char *raw) {
    size_t scheme = strncasecmp(raw, "http://", 7) == 0 ? 7 : strncasecmp(raw, "https://", 8) == 0 ? 8 : 0;
    if (scheme == 0)
        return raw;
    size_t length = strcspn(raw + scheme, "/?#");
    t->authority = mem_strndup(raw + scheme, length);
    return raw + scheme + length;
}

enum status target_parse(struct target *t, const char *raw, struct error *err) {
    memset(t, 0, sizeof *t);
    raw = take_authority(t, raw);
    size_t path_length = strcspn(raw, "?");
    /* An absolute form may have no path (RFC 9110, 4.2.3). */
    t->path = t->authority && path_length == 0 ? mem_strdup("/") : mem_strndup(raw, path_length);
    for (char *at = t->path; *at; at++)
        if (*at <= 0x20 || *at >= 0x7f) /* negative values too; the text goes into logs and replies */
            *at = '?';
    for (const char *at = raw; *at; at++)
        if (*at <= 0x20 || *at >= 0x7f)
            return error_set(err, STATUS_INPUT, "the request target has a byte that no URL may have");
    if (t->path[0] != '/')
        return error_set(err, STATUS_INPUT, "the request target does not begin with a slash");
    if (strchr(raw, '#'))
        return error_set(err, STATUS_INPUT, "the request target has a fragment (#)");
    enum status status = parse_path(t, err);
    if (status == STATUS_OK && raw[path_length] == '?')
        status = parse_query(t, raw + path_length + 1, err);
    return status;
}

void target_release(struct target *t) {
    mem_free(t->authority);
    mem_free(t->path);
    for (size_t i = 0; i < t->segment_count; i++)
        mem_free(t->segments[i]);
    for (size_t i = 0; i < t->query_count; i++) {
        mem_free(t->names[i]);
        mem_free(t->values[i]);
    }
    memset(t, 0, sizeof *t);
}

const char *target_query(const struct target *t, const char *name) {
    for (size_t i = 0; i < t->query_count; i++)
        if (strcmp(t->names[i], name) == 0)
            return t->values[i];
    return NULL;
}

char *target_rest(const struct target *t, size_t first) {
    struct buf rest;
    buf_init(&rest, SIZE_MAX / 2);
    for (size_t i = first; i < t->segment_count; i++)
        buf_printf(&rest, "%s%s", i > first ? "/" : "", t->segments[i]);
    return buf_detach(&rest);
}
