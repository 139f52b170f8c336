/* target.h -- the request target (RFC 9112, 3.2) in origin form ("/path") or absolute form ("http://host/path", as
 * clients send it to proxies), taken apart by us: libmicrohttpd decodes %2F and %00 before anybody can tell them
 * from what they stand for.
 *
 * 1. A segment is decoded after the path was split, so an encoded slash never splits a path.
 * 2. Decoded text is UTF-8 and holds no control byte; no path holds an empty, "." or ".." part,
 *    whether written with slashes or with %2F. */
#ifndef UNBAKE_NET_TARGET_H
#define UNBAKE_NET_TARGET_H

#include <stddef.h>

#include "common/error.h"

#define TARGET_SEGMENTS_MAX 16 /* of a path */
#define TARGET_QUERY_MAX 16    /* parameters of a query */

struct target {
    char *authority; /* of an absolute form, "host:port", unchecked; overrides Host; owned; or NULL */
    char *path;      /* as sent, without the query; '?' for bytes that no URL may have; owned */
    char *segments[TARGET_SEGMENTS_MAX]; /* decoded; owned; none for "/" */
    size_t segment_count;
    char *names[TARGET_QUERY_MAX], *values[TARGET_QUERY_MAX]; /* decoded query; owned */
    size_t query_count;
};

/* Fills *t, which needs target_release also after an error (STATUS_INPUT). */
enum status target_parse(struct target *t, const char *raw, struct error *err);
void target_release(struct target *t);

/* The value of a query parameter, NULL where it is absent; borrowed. */
const char *target_query(const struct target *t, const char *name);

/* The segments from `first` on, joined by slashes; the caller's (mem_free). */
char *target_rest(const struct target *t, size_t first);

#endif
