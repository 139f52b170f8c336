/* url.c -- see url.h. */
#include "common/url.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static enum status bad(const char *text, const char *why, struct error *err) {
    return error_set(err, STATUS_INPUT, "\"%.100s\" %s", text, why);
}

enum status url_parse(const char *text, struct url *url, struct error *err) {
    static const char host_characters[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-._";
    *url = (struct url){.is_tls = strncmp(text, "https://", 8) == 0};
    if (!url->is_tls && strncmp(text, "http://", 7) != 0)
        return bad(text, "is not a URL that begins with https:// or http://", err);
    if (strlen(text) > URL_MAX_BYTES)
        return bad(text, "is too long", err);
    for (const char *c = text; *c; c++)
        if (*c <= 0x20 || *c >= 0x7f || strchr("\"<>\\^`{|}#", *c))
            return bad(text, "has a character that no such URL has", err);
    const char *host = text + (url->is_tls ? 8 : 7), *end = host + strcspn(host, "/?");
    if (memchr(host, '@', (size_t)(end - host)))
        return bad(text, "has a user's name in it", err);
    const char *after = host;
    if (*host == '[') {
        host++;
        after = host + strspn(host, "0123456789abcdefABCDEF:.");
        if (*after != ']')
            return bad(text, "has no address between its brackets", err);
    } else {
        after = host + strspn(host, host_characters);
    }
    size_t length = (size_t)(after - host);
    if (length == 0 || length >= sizeof url->host)
        return bad(text, "names no host", err);
    memcpy(url->host, host, length);
    after += *after == ']';
    snprintf(url->port, sizeof url->port, "%s", url->is_tls ? "443" : "80");
    if (*after == ':') {
        size_t digits = strspn(after + 1, "0123456789");
        long port = digits > 0 && digits < 6 ? strtol(after + 1, NULL, 10) : 0;
        if (port < 1 || port > 65535)
            return bad(text, "has no good port", err);
        snprintf(url->port, sizeof url->port, "%d", (int)(port & 0xffff));
        after += 1 + digits;
    }
    if (after != end)
        return bad(text, "has no good host", err);
    url->target = end;
    return STATUS_OK;
}

void url_encode(struct buf *out, const char *text, bool keep_slash) {
    for (; *text; text++) {
        unsigned char c = (unsigned char)*text;
        bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                     strchr("-._~", c) != NULL || (keep_slash && c == '/');
        if (plain)
            buf_append(out, text, 1);
        else
            buf_printf(out, "%%%02X", c);
    }
}
