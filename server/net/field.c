/* field.c -- see field.h. */
#include "server/net/field.h"

#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "common/base64.h"

static bool is_digit(char c) { return c >= '0' && c <= '9'; }

bool field_is_token(const char *text) {
    if (*text == '\0')
        return false;
    for (; *text; text++)
        if (!is_digit(*text) && !(*text >= 'a' && *text <= 'z') && !(*text >= 'A' && *text <= 'Z') &&
            !strchr("!#$%&'*+-.^_`|~", *text))
            return false;
    return true;
}

bool field_etag_listed(const char *list, const char *etag, bool weak) {
    list += strspn(list, " \t");
    if (list[0] == '*' && list[1 + strspn(list + 1, " \t")] == '\0')
        return true;
    size_t wanted = strlen(etag);
    for (const char *at = list; *at;) {
        at += strspn(at, " \t,");
        bool is_weak = strncmp(at, "W/", 2) == 0;
        at += is_weak ? 2 : 0;
        const char *end = *at == '"' ? strchr(at + 1, '"') : NULL;
        if (!end)
            return false;
        size_t length = (size_t)(end + 1 - at);
        if ((weak || !is_weak) && length == wanted && memcmp(at, etag, wanted) == 0)
            return true;
        at = end + 1;
    }
    return false;
}

bool field_accepts(const char *accept, const char *type) {
    while (*accept) {
        accept += strspn(accept, " \t,");
        size_t length = strcspn(accept, ",");
        size_t name = strcspn(accept, ",; \t");
        if (name == strlen(type) && strncasecmp(accept, type, name) == 0)
            return true;
        accept += length;
    }
    return false;
}

bool field_is_type(const char *content_type, const char *type) {
    size_t name = strcspn(content_type, "; \t");
    return name == strlen(type) && strncasecmp(content_type, type, name) == 0;
}

/* Reads digits from *at on; false when there are none or too many. */
static bool read_digits(const char **at, uint64_t *value) {
    const char *start = *at;
    *value = 0;
    for (; is_digit(**at); (*at)++) {
        if (*at - start >= 18)
            return false;
        *value = *value * 10 + (uint64_t)(**at - '0');
    }
    return *at > start;
}

enum field_range field_range(const char *range, uint64_t size, uint64_t *first, uint64_t *count) {
    if (strncasecmp(range, "bytes=", 6) != 0)
        return FIELD_RANGE_WHOLE;
    const char *at = range + 6;
    at += strspn(at, " \t");
    uint64_t from = 0, last = 0;
    bool has_from = is_digit(*at), has_last = false;
    if (has_from && !read_digits(&at, &from))
        return FIELD_RANGE_WHOLE;
    if (*at++ != '-')
        return FIELD_RANGE_WHOLE;
    if (is_digit(*at)) {
        has_last = true;
        if (!read_digits(&at, &last))
            return FIELD_RANGE_WHOLE;
    }
    if (at[strspn(at, " \t")] != '\0' || (!has_from && !has_last) || (has_from && has_last && last < from))
        return FIELD_RANGE_WHOLE;
    if (!has_from) { /* a suffix range: the last bytes */
        if (last == 0 || size == 0)
            return FIELD_RANGE_OUTSIDE;
        *count = last < size ? last : size;
        *first = size - *count;
        return FIELD_RANGE_PART;
    }
    if (from >= size)
        return FIELD_RANGE_OUTSIDE;
    *first = from;
    *count = has_last && last < size ? last - from + 1 : size - from;
    return FIELD_RANGE_PART;
}

bool field_digest(const char *repr_digest, char hex[65]) {
    const char *at = strstr(repr_digest, "sha-256=:");
    if (!at || (at > repr_digest && !strchr(" ,\t", at[-1])))
        return false;
    at += 9;
    uint8_t bytes[32];
    size_t length = strcspn(at, ":"), used;
    if (at[length] != ':' || !base64_decode(at, length, bytes, sizeof bytes, &used) || used != sizeof bytes)
        return false;
    for (size_t i = 0; i < sizeof bytes; i++)
        snprintf(hex + 2 * i, 3, "%02x", bytes[i]);
    return true;
}

static unsigned hex_value(char c) { return (unsigned)(is_digit(c) ? c - '0' : c - 'a' + 10); }

void field_digest_format(const char *hex, char text[64]) {
    uint8_t bytes[32];
    struct buf value;
    buf_init(&value, 64);
    for (size_t i = 0; i < sizeof bytes; i++)
        bytes[i] = (uint8_t)(hex_value(hex[2 * i]) << 4 | hex_value(hex[2 * i + 1]));
    buf_puts(&value, "sha-256=:");
    base64_append(&value, bytes, sizeof bytes);
    buf_puts(&value, ":");
    snprintf(text, 64, "%s", buf_text(&value));
    buf_release(&value);
}

bool field_number(const char *text, int64_t minimum, int64_t maximum, int64_t *value) {
    bool negative = *text == '-';
    uint64_t magnitude;
    text += negative ? 1 : 0;
    if (!read_digits(&text, &magnitude) || *text != '\0')
        return false;
    *value = negative ? -(int64_t)magnitude : (int64_t)magnitude;
    return *value >= minimum && *value <= maximum;
}

bool field_host(const char *host, size_t *length) {
    const char *at = host;
    if (*at == '[') {
        at += 1 + strspn(at + 1, "0123456789abcdefABCDEF:.");
        if (*at++ != ']')
            return false;
    } else {
        at += strspn(at, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-._");
        if (at == host)
            return false;
    }
    *length = (size_t)(at - host);
    if (*at == ':')
        at += 1 + strspn(at + 1, "0123456789");
    return *at == '\0';
}

bool field_is_loopback_host(const char *host, size_t length) {
    static const char suffix[] = ".localhost";
    size_t suffix_length = sizeof suffix - 1;
    if (length == 9 && strncasecmp(host, "localhost", 9) == 0)
        return true;
    if (length > suffix_length && strncasecmp(host + length - suffix_length, suffix, suffix_length) == 0)
        return true;
    if (length == 5 && memcmp(host, "[::1]", 5) == 0)
        return true;
    /* 127.0.0.0/8: digits and dots only, so that no host name can pass for it */
    return length > 4 && memcmp(host, "127.", 4) == 0 && strspn(host, "0123456789.") >= length;
}
