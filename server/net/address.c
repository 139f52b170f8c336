/* address.c -- see address.h. */
#include "server/net/address.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

static const uint8_t v4_prefix[12] = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xff, 0xff};

static bool is_v4(const struct address *a) { return memcmp(a->bytes, v4_prefix, sizeof v4_prefix) == 0; }

/* An address alone. */
static bool parse_bare(const char *text, size_t length, struct address *a) {
    char copy[INET6_ADDRSTRLEN];
    if (length == 0 || length >= sizeof copy)
        return false;
    memcpy(copy, text, length);
    copy[length] = '\0';
    memcpy(a->bytes, v4_prefix, sizeof v4_prefix);
    return inet_pton(AF_INET, copy, a->bytes + 12) == 1 || inet_pton(AF_INET6, copy, a->bytes) == 1;
}

bool address_parse(const char *text, size_t length, struct address *a) {
    const char *colon = memchr(text, ':', length);
    if (length > 0 && *text == '[') {
        const char *end = memchr(text, ']', length);
        size_t rest = end ? length - (size_t)(end + 1 - text) : 0;
        return end && (rest == 0 || end[1] == ':') && parse_bare(text + 1, (size_t)(end - text) - 1, a);
    }
    if (colon && !memchr(colon + 1, ':', length - (size_t)(colon + 1 - text)))
        length = (size_t)(colon - text); /* IPv4 with a port */
    return parse_bare(text, length, a);
}

struct address address_of_socket(const struct sockaddr *from) {
    struct address a = {{0}};
    if (from && from->sa_family == AF_INET) {
        memcpy(a.bytes, v4_prefix, sizeof v4_prefix);
        memcpy(a.bytes + 12, &((const struct sockaddr_in *)from)->sin_addr, 4);
    } else if (from && from->sa_family == AF_INET6) {
        memcpy(a.bytes, &((const struct sockaddr_in6 *)from)->sin6_addr, 16);
    }
    return a;
}

void address_text(const struct address *a, char text[ADDRESS_TEXT_SIZE]) {
    bool four = is_v4(a);
    if (!inet_ntop(four ? AF_INET : AF_INET6, a->bytes + (four ? 12 : 0), text, ADDRESS_TEXT_SIZE))
        *text = '\0';
}

/* --- proxies ----------------------------------------------------------------------------- */

static bool parse_net(const char *text, size_t length, struct address *base, unsigned *bits) {
    const char *slash = memchr(text, '/', length);
    size_t host = slash ? (size_t)(slash - text) : length;
    if (!parse_bare(text, host, base))
        return false;
    unsigned most = is_v4(base) ? 32 : 128;
    *bits = most;
    if (slash) {
        size_t digits = length - host - 1;
        if (digits < 1 || digits > 3 || strspn(slash + 1, "0123456789") < digits)
            return false;
        *bits = (unsigned)strtoul(slash + 1, NULL, 10);
    }
    if (*bits > most)
        return false;
    *bits += 128 - most;
    return true;
}

enum status proxies_parse(struct proxies *p, const char *list, const char *field, struct error *err) {
    static const char *const fields[] = {"X-Forwarded-For", "Forwarded"};
    memset(p, 0, sizeof *p);
    for (size_t i = 0; i < 2; i++)
        if (strcasecmp(field, fields[i]) == 0)
            p->field = fields[i];
    if (!p->field)
        return error_set(err, STATUS_INPUT, "proxy_field must be X-Forwarded-For or Forwarded, not \"%s\"", field);
    for (const char *at = list + strspn(list, " ,\t"); *at; at += strspn(at, " ,\t")) {
        size_t length = strcspn(at, " ,\t");
        if (p->count == ADDRESS_PROXIES_MAX)
            return error_set(err, STATUS_INPUT, "trusted_proxies has more than %d addresses", ADDRESS_PROXIES_MAX);
        if (!parse_net(at, length, &p->net[p->count].base, &p->net[p->count].bits))
            return error_set(err, STATUS_INPUT,
                             "trusted_proxies must be addresses like 127.0.0.1, ::1 or 10.0.0.0/8, "
                             "not \"%.*s\"",
                             (int)length, at);
        p->count++;
        at += length;
    }
    return STATUS_OK;
}

bool proxies_trust(const struct proxies *p, const struct address *a) {
    for (size_t i = 0; i < p->count; i++) {
        unsigned bytes = p->net[i].bits / 8, bits = p->net[i].bits % 8;
        const uint8_t *base = p->net[i].base.bytes;
        if (memcmp(base, a->bytes, bytes) == 0 && (bits == 0 || (base[bytes] ^ a->bytes[bytes]) >> (8 - bits) == 0))
            return true;
    }
    return false;
}

/* --- the fields -------------------------------------------------------------------------- */

/* Takes the last comma-separated element off value[*length], minding quotes; false where none is left. */
static bool take_last(const char *value, size_t *length, const char **element, size_t *size) {
    size_t start = 0;
    bool is_quoted = false;
    if (*length == 0)
        return false;
    for (size_t i = 0; i < *length; i++) {
        if (value[i] == '\\' && is_quoted)
            i++;
        else if (value[i] == '"')
            is_quoted = !is_quoted;
        else if (value[i] == ',' && !is_quoted)
            start = i + 1;
    }
    *element = value + start;
    *size = *length - start;
    *length = start > 0 ? start - 1 : 0;
    return true;
}

static void trim(const char **text, size_t *length) {
    while (*length > 0 && strchr(" \t", **text))
        ++*text, --*length;
    while (*length > 0 && strchr(" \t", (*text)[*length - 1]))
        --*length;
}

/* Reduces one element of Forwarded to the value of its for=, without quotes; leaves it alone if it has none. */
static void take_for(const char **text, size_t *length) {
    for (const char *at = *text, *end = *text + *length; at < end;) {
        size_t size = 0;
        bool is_quoted = false;
        for (; at + size < end && (is_quoted || at[size] != ';'); size++)
            is_quoted ^= at[size] == '"';
        const char *pair = at;
        size_t pair_length = size;
        trim(&pair, &pair_length);
        if (pair_length > 4 && strncasecmp(pair, "for=", 4) == 0) {
            *text = pair + 4;
            *length = pair_length - 4;
            if (*length > 1 && **text == '"' && (*text)[*length - 1] == '"')
                ++*text, *length -= 2;
            return;
        }
        at += size + 1;
    }
    *length = 0;
}

struct address address_of_request(const struct field *field, size_t count, const struct address *peer,
                                  const struct proxies *p) {
    struct address at = *peer, next;
    bool is_forwarded = p->field && strcmp(p->field, "Forwarded") == 0;
    for (size_t i = count; i-- > 0;) {
        if (!p->field || strcasecmp(field[i].name, p->field) != 0)
            continue;
        const char *value = field[i].value, *element;
        size_t left = strlen(value), size;
        while (take_last(value, &left, &element, &size)) {
            if (is_forwarded)
                take_for(&element, &size);
            trim(&element, &size);
            if (!proxies_trust(p, &at) || !address_parse(element, size, &next))
                return at;
            at = next;
        }
    }
    return at;
}
