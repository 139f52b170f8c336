/* outputs.c -- the files that a job makes, and its log.
 *
 * 1. A file's name comes from the store's row, never from the URL, and no part of its path below
 *    DATA/jobs/ may be a symbolic link.
 * 2. ETag and Repr-Digest are those of the bytes in the reply (digests.h). Before the digest is known the tag is of the
 *    file's version, as strong, and there is no Repr-Digest. */
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/file.h"
#include "common/mem.h"
#include "server/data/job_file.h"
#include "server/http/auth.h"
#include "server/http/handlers.h"
#include "server/http/problem.h"
#include "server/http/views.h"
#include "server/net/field.h"
#include "server/uploads/digests.h"

#define ETAG_SIZE 80
#define LOG_BYTES_DEFAULT 65536
#define LOG_BYTES_MAX (1 << 20)

struct response *outputs_list(struct api *api, struct request *r) {
    struct response *refusal = NULL;
    int64_t id = auth_job_id(api, r, ACCESS_READ, &refusal);
    if (refusal)
        return refusal;
    struct output_row *rows = NULL;
    size_t count = 0;
    struct error err;
    if (store_output_list(api->store, id, &rows, &count, &err) != STATUS_OK)
        return problem_from(r, &err);
    cJSON *value = cJSON_CreateObject(), *items = cJSON_AddArrayToObject(value, "items");
    for (size_t i = 0; i < count; i++) {
        cJSON_AddItemToArray(items, view_output(id, &rows[i]));
        output_row_release(&rows[i]);
    }
    mem_free(rows);
    return response_json(200, value);
}

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
    /* A worker wrote the file from a stranger's upload: in a browser it must not act with its reader's rights. */
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

/* Whether the request asks for a part of the content with a certain digest while that of this file is not known yet. */
static bool is_too_early(const struct request *r, const struct digests_file *file) {
    const char *if_range = request_field(r, "If-Range");
    return !*file->hex && !r->is_head && request_field(r, "Range") && if_range &&
           strncmp(if_range, "\"sha256-", 8) == 0;
}

/* The reply that sends the open file; takes fd. */
static struct response *send_file(struct api *api, const struct request *r, int64_t job_id, int fd,
                                  const struct output_row *row) {
    struct digests_file file;
    char etag[ETAG_SIZE], version_etag[ETAG_SIZE];
    struct error err;
    struct response *reply = NULL;
    if (digests_look(api->digests, job_id, row, fd, &file, &err) != STATUS_OK) {
        reply = problem_from(r, &err);
    } else if (is_too_early(r, &file)) {
        reply = problem(r, 503, "the file's digest is being computed");
        response_field(reply, "Retry-After", "1");
    }
    if (reply) {
        close(fd);
        return reply;
    }
    make_etag(&file, *file.hex, etag);
    make_etag(&file, false, version_etag);
    const char *known = request_field(r, "If-None-Match");
    if (known && (field_etag_listed(known, etag, true) || field_etag_listed(known, version_etag, true))) {
        close(fd);
        reply = response_new(304);
    } else {
        reply = send_bytes(r, fd, &file, row->content_type, version_etag, etag);
    }
    response_field(reply, "ETag", "%s", etag);
    response_field(reply, "Accept-Ranges", "bytes");
    response_field(reply, "Cache-Control", "no-cache");
    return reply;
}

struct response *outputs_get(struct api *api, struct request *r) {
    struct response *reply = NULL;
    int64_t id = auth_job_id(api, r, ACCESS_READ, &reply);
    if (reply)
        return reply;
    char *name = target_rest(&r->target, 4);
    struct output_row row;
    struct error err;
    int fd = -1;
    enum status status = store_output_get(api->store, id, name, &row, &err);
    mem_free(name);
    if (status != STATUS_OK)
        return problem_from(r, &err);
    status = job_file_open_output(api->config.data_dir, id, row.name, &fd, &err);
    if (status == STATUS_OK)
        reply = send_file(api, r, id, fd, &row);
    else
        reply = problem_from(r, &err);
    output_row_release(&row);
    return reply;
}

/* --- the log ----------------------------------------------------------------------------- */

/* The last `bytes` bytes of fd, starting at a whole line; the caller's. */
static char *read_tail(int fd, size_t bytes, size_t *length) {
    struct stat info;
    off_t size = fstat(fd, &info) == 0 && S_ISREG(info.st_mode) ? info.st_size : 0;
    off_t from = size > (off_t)bytes ? size - (off_t)bytes : 0;
    char *text = mem_alloc(bytes + 1);
    size_t used = 0;
    while (used < bytes) {
        ssize_t got = pread(fd, text + used, bytes - used, from + (off_t)used);
        if (got < 0 && errno == EINTR)
            continue;
        if (got <= 0)
            break;
        used += (size_t)got;
    }
    char *line = from > 0 ? memchr(text, '\n', used) : NULL;
    size_t skip = line ? (size_t)(line + 1 - text) : 0;
    memmove(text, text + skip, used - skip);
    *length = used - skip;
    return text;
}

struct response *jobs_log(struct api *api, struct request *r) {
    struct response *refusal = NULL;
    const char *wanted = target_query(&r->target, "bytes");
    int64_t bytes = LOG_BYTES_DEFAULT;
    if (wanted && !field_number(wanted, 1, LOG_BYTES_MAX, &bytes))
        return problem(r, 400, "bytes must be a number from 1 to %d", LOG_BYTES_MAX);
    int64_t id = auth_job_id(api, r, ACCESS_READ, &refusal);
    if (refusal)
        return refusal;
    int fd = -1;
    size_t length = 0;
    struct error err;
    enum status status = job_file_open_log(api->config.data_dir, id, &fd, &err);
    if (status != STATUS_OK && status != STATUS_NOT_FOUND)
        return problem_from(r, &err);
    char *text = fd >= 0 ? read_tail(fd, (size_t)bytes, &length) : mem_strdup("");
    if (fd >= 0)
        close(fd);
    struct response *reply = response_text(200, "text/plain; charset=utf-8", text, length);
    response_field(reply, "Cache-Control", "no-store");
    return reply;
}
