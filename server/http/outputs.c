/* outputs.c -- the files that a job makes, and its log.
 *
 * 1. A file's name comes from the store's row, never from the URL, and no part of its path below
 *    DATA/jobs/ may be a symbolic link.
 * 2. ETag and Repr-Digest are those of the bytes in the reply (digests.h). */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/file.h"
#include "common/mem.h"
#include "server/http/auth.h"
#include "server/http/digests.h"
#include "server/http/field.h"
#include "server/http/handlers.h"
#include "server/http/problem.h"
#include "server/http/views.h"

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

/* Opens `path` below DATA/jobs/, one part after the other, following no link. */
static enum status open_beneath(const struct api *api, const char *path, int *out, struct error *err) {
    char *root = file_join(api->config.data_dir, "jobs");
    int fd = open(root, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    mem_free(root);
    for (const char *at = path; fd >= 0 && *at;) {
        char part[256];
        size_t length = strcspn(at, "/");
        bool is_last = at[length] == '\0';
        int next = -1;
        if (length < sizeof part) {
            snprintf(part, sizeof part, "%.*s", (int)length, at);
            next = openat(fd, part, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC |
                          (is_last ? 0 : O_DIRECTORY));
        } else {
            errno = ENAMETOOLONG;
        }
        int number = errno;
        close(fd);
        errno = number;
        fd = next;
        at += length + (is_last ? 0 : 1);
    }
    *out = fd;
    return fd >= 0 ? STATUS_OK : error_set_errno(err, errno, "cannot open jobs/%s", path);
}

/* The part of the file that is asked for, or all of it. */
static void apply_range(const struct request *r, const char *etag, uint64_t size, struct response **reply) {
    const char *range = request_field(r, "Range"), *if_range = request_field(r, "If-Range");
    uint64_t first = 0, count = size;
    if (!range || (if_range && strcmp(if_range, etag) != 0))
        return;
    switch (field_range(range, size, &first, &count)) {
    case FIELD_RANGE_WHOLE:
        return;
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

/* The reply that sends the open file; takes fd. */
static struct response *send_file(struct api *api, const struct request *r, int fd,
                                  const char *content_type) {
    uint64_t size;
    char hex[SHA256_HEX_SIZE], etag[80], digest[64];
    struct error err;
    if (digests_of(api->digests, fd, &size, hex, &err) != STATUS_OK) {
        close(fd);
        return problem_from(r, &err);
    }
    snprintf(etag, sizeof etag, "\"sha256-%s\"", hex);
    field_digest_format(hex, digest);
    const char *known = request_field(r, "If-None-Match");
    struct response *reply = response_new(known && field_etag_listed(known, etag, true) ? 304 : 200);
    if (reply->status == 304) {
        close(fd);
    } else {
        reply->fd = fd;
        reply->length = size;
        response_field(reply, "Content-Type", "%s", content_type);
        /* A worker wrote it, from what a stranger uploaded: in a browser it must not act as its reader. */
        response_field(reply, "Content-Security-Policy", "sandbox allow-same-origin; script-src 'none'");
        response_field(reply, "Repr-Digest", "%s", digest);
        apply_range(r, etag, size, &reply);
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
    char *path = mem_printf("%lld/out/%s", (long long)id, row.name);
    status = open_beneath(api, path, &fd, &err);
    mem_free(path);
    if (status == STATUS_OK)
        reply = send_file(api, r, fd, row.content_type);
    else
        reply = problem_from(r, &err);
    output_row_release(&row);
    return reply;
}

/* --- the log ----------------------------------------------------------------------------- */

/* The last `bytes` bytes of fd, from the first whole line on; the caller's. */
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
    char path[48];
    snprintf(path, sizeof path, "%lld/worker.log", (long long)id);
    int fd = -1;
    size_t length = 0;
    struct error err;
    enum status status = open_beneath(api, path, &fd, &err);
    if (status != STATUS_OK && status != STATUS_NOT_FOUND)
        return problem_from(r, &err);
    char *text = fd >= 0 ? read_tail(fd, (size_t)bytes, &length) : mem_strdup("");
    if (fd >= 0)
        close(fd);
    struct response *reply = response_text(200, "text/plain; charset=utf-8", text, length);
    response_field(reply, "Cache-Control", "no-store");
    return reply;
}
