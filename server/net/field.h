/* field.h -- the syntax of header fields (RFC 9110), as pure functions. */
#ifndef UNBAKE_NET_FIELD_H
#define UNBAKE_NET_FIELD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct field {
    char *name, *value; /* owned */
};

bool field_is_token(const char *text); /* RFC 9110, 5.6.2; not empty */

/* True when the comma-separated list of entity tags in `list` (or "*") names `etag` (with its
 * quotes). `weak` lets W/"x" match "x", as If-None-Match wants and If-Match does not. */
bool field_etag_listed(const char *list, const char *etag, bool weak);

/* True when the comma-separated list of media types in an Accept field names `type`. */
bool field_accepts(const char *accept, const char *type);

/* True when the media type of a Content-Type field is `type`, whatever its parameters. */
bool field_is_type(const char *content_type, const char *type);

enum field_range { FIELD_RANGE_WHOLE, FIELD_RANGE_PART, FIELD_RANGE_OUTSIDE };

/* Reads a Range field for a file of `size` bytes. PART sets *first and *count (at least 1).
 * Several ranges, other units and bad syntax mean the whole file (RFC 9110, 14.2). */
enum field_range field_range(const char *range, uint64_t size, uint64_t *first, uint64_t *count);

/* Reads "sha-256=:base64:" out of a Repr-Digest field (RFC 9530) into 64 hex digits and a NUL; false where it is
 * absent or malformed. */
bool field_digest(const char *repr_digest, char hex[65]);
/* The inverse; `text` holds at least 64 characters. */
void field_digest_format(const char *hex, char text[64]);

/* A decimal number in [minimum, maximum] and nothing else. */
bool field_number(const char *text, int64_t minimum, int64_t maximum, int64_t *value);

/* The first *length bytes of `host` are its name without the port; false when the syntax is bad. An IPv6 address
 * keeps its brackets. `host` is a Host field, or the host of an Origin. */
bool field_host(const char *host, size_t *length);
/* True for localhost, *.localhost, 127.0.0.0/8 and [::1]. */
bool field_is_loopback_host(const char *host, size_t length);

#endif
