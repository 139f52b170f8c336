/* outputs.c -- the files that a job makes, and its log.
 *
 * 1. A file's name comes from the store's row, never from the URL, and no part of its path below
 *    DATA/jobs/ may be a symbolic link.
 * 2. ETag and Repr-Digest are those of the bytes in the reply (digests.h). Before the digest is known the tag is of the
 *    file's version, as strong, and there is no Repr-Digest. */
#include <errno.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/mem.h"
#include "server/data/work_file.h"
#include "server/http/auth.h"
#include "server/http/file_reply.h"
#include "server/http/handlers.h"
#include "server/http/views.h"
#include "server/net/field.h"
#include "server/transport/problem.h"
#include "server/uploads/digests.h"

#define LOG_BYTES_DEFAULT 65536 /* of the end of a log, without ?bytes= */
#define LOG_BYTES_MAX (1 << 20) /* with it */

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
    struct error err;
    struct response *reply = NULL;
    if (digests_identify(api->digests, job_id, row, fd, &file, &err) != STATUS_OK) {
        reply = problem_from(r, &err);
    } else if (is_too_early(r, &file)) {
        reply = problem(r, 503, "the file's digest is being computed");
        response_field(reply, "Retry-After", "1");
    }
    if (reply) {
        close(fd);
        return reply;
    }
    return file_reply(r, fd, &file, row->content_type);
}

/* Opens the file that the row names. Another attempt may have replaced it since the row was read, which removes it:
 * then the row is read again. *row needs output_row_release in any case. */
static enum status open_output(struct api *api, int64_t job_id, const char *name, struct output_row *row, int *fd,
                               struct error *err) {
    int before;
    enum status status = store_output_get(api->store, job_id, name, row, err);
    do {
        if (status != STATUS_OK)
            return status;
        before = row->attempt;
        status = work_file_open_output(api->config.data_dir, job_id, row->attempt, row->name, fd, err);
        if (status != STATUS_NOT_FOUND)
            return status;
        output_row_release(row);
        status = store_output_get(api->store, job_id, name, row, err);
    } while (status != STATUS_OK || row->attempt != before);
    return error_set(err, STATUS_NOT_FOUND, "the file of output %.200s is gone", name);
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
    enum status status = open_output(api, id, name, &row, &fd, &err);
    mem_free(name);
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
    enum status status = work_file_open_log(api->config.data_dir, id, &fd, &err);
    if (status != STATUS_OK && status != STATUS_NOT_FOUND)
        return problem_from(r, &err);
    char *text = fd >= 0 ? read_tail(fd, (size_t)bytes, &length) : mem_strdup("");
    if (fd >= 0)
        close(fd);
    struct response *reply = response_text(200, "text/plain; charset=utf-8", text, length);
    response_field(reply, "Cache-Control", "no-store");
    return reply;
}
