/* file_reply.c -- see file_reply.h. */
#include "server/http/file_reply.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "server/net/field.h"
#include "server/transport/problem.h"

#define ETAG_SIZE 80 /* "sha256-..." and the NUL, rounded up */

/* A strong ETag for the file: from its content where the digest is known, else from its version. */
static void make_etag(const struct digests_file *file, bool by_content, char etag[ETAG_SIZE]) {
    if (by_content)
        snprintf(etag, ETAG_SIZE, "\"sha256-%s\"", file->hex);
    else
        snprintf(etag, ETAG_SIZE, "\"file-%s\"", file->tag);
}

/* Applies Range: the part of the file that is asked for, or all of it. Only for GET (RFC 9110, 14.2). */
static void apply_range(const struct request *r, uint64_t size, struct response **reply) {
    const char *range = request_field(r, "Range");
    uint64_t first = 0, count = size;
    switch (field_range(range, size, &first, &count)) {
    case FIELD_RANGE_WHOLE: return;
    case FIELD_RANGE_PART:
        (*reply)->status = 206;
        (*reply)->offset = first;
        (*reply)->length = count;
        response_field(*reply, "Content-Range", "bytes %llu-%llu/%llu", (unsigned long long)first,
                       (unsigned long long)(first + count - 1), (unsigned long long)size);
        return;
    case FIELD_RANGE_OUTSIDE:
        response_free(*reply);
        *reply = problem(r, 416, "the file has %llu bytes", (unsigned long long)size);
        response_field(*reply, "Content-Range", "bytes */%llu", (unsigned long long)size);
        return;
    }
}

/* The file or a part of it, with its header fields. Where If-Range named an ETag of this version, that one is sent:
 * whoever has a part under that ETag can tell that the rest belongs to it. */
static struct response *send_bytes(const struct request *r, int fd, const struct digests_file *file,
                                   const char *content_type, const char *version_etag, char etag[ETAG_SIZE]) {
    const char *if_range = request_field(r, "If-Range");
    char digest[64];
    struct response *reply = response_new(200);
    reply->fd = fd;
    reply->length = file->bytes;
    response_field(reply, "Content-Type", "%s", content_type);
    /* A worker wrote the file from an untrusted upload: in a browser it must not act with its reader's rights. */
    response_field(reply, "Content-Security-Policy", "sandbox allow-same-origin; script-src 'none'");
    if (*file->hex) {
        field_digest_format(file->hex, digest);
        response_field(reply, "Repr-Digest", "%s", digest);
    }
    bool is_same = !if_range || strcmp(if_range, etag) == 0 || strcmp(if_range, version_etag) == 0;
    if (!request_field(r, "Range") || r->is_head || !is_same)
        return reply;
    if (if_range)
        snprintf(etag, ETAG_SIZE, "%s", if_range);
    apply_range(r, file->bytes, &reply);
    return reply;
}

struct response *file_reply(const struct request *r, int fd, const struct digests_file *file,
                            const char *content_type) {
    char etag[ETAG_SIZE], version_etag[ETAG_SIZE];
    struct response *reply;
    make_etag(file, *file->hex, etag);
    make_etag(file, false, version_etag);
    const char *known = request_field(r, "If-None-Match");
    if (known && (field_etag_listed(known, etag, true) || field_etag_listed(known, version_etag, true))) {
        close(fd);
        reply = response_new(304);
    } else {
        reply = send_bytes(r, fd, file, content_type, version_etag, etag);
    }
    response_field(reply, "ETag", "%s", etag);
    response_field(reply, "Accept-Ranges", "bytes");
    response_field(reply, "Cache-Control", "no-cache");
    return reply;
}
