/* upload.c -- see upload.h. */
#include "server/uploads/upload.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/file.h"
#include "common/mem.h"
#include "common/utf8.h"
#include "server/http/field.h"
#include "server/http/limits.h"
#include "server/http/problem.h"
#include "server/http/space.h"

/* Every so many bytes: start writing them out, so that the sync at the end is short, and look
 * whether others have filled the disk meanwhile. */
#define STEP_BYTES ((uint64_t)32 << 20)

struct upload {
    int fd;
    char *path; /* NULL once published */
    struct sha256 hash;
    uint64_t bytes;
    uint64_t step_start; /* where the present step began */
    bool is_reserved;    /* the space for all of it is ours already */
};

uint64_t upload_bytes(const struct upload *u) {
    return u->bytes;
}

void upload_free(struct upload *u) {
    if (!u)
        return;
    if (u->fd >= 0)
        close(u->fd);
    if (u->path)
        unlink(u->path);
    mem_free(u->path);
    mem_free(u);
}

static struct response *check_request(const struct request *r) {
    const char *sha256 = request_field(r, "X-Content-SHA256");
    const char *digest = request_field(r, "Repr-Digest");
    const char *name = target_query(&r->target, "name");
    char hex[SHA256_HEX_SIZE];
    if (!r->has_body || r->content_length == 0)
        return problem_full(r, 400, "the body, an archive of the bundle, is missing",
                            "curl -T room.zip -X POST URL", NULL);
    if (sha256 && (strspn(sha256, "0123456789abcdefABCDEF") != 64 || sha256[64] != '\0'))
        return problem(r, 400, "X-Content-SHA256 is not 64 hex digits");
    if (digest && !field_digest(digest, hex))
        return problem(r, 400, "Repr-Digest has no sha-256 that can be read");
    if (name && (strlen(name) > API_NAME_MAX_BYTES || *name == '\0'))
        return problem(r, 400, "name must have 1 to %d bytes, not %zu", API_NAME_MAX_BYTES, strlen(name));
    if (name && !utf8_is_name(name))
        return problem(r, 400, "name has a control character");
    return NULL;
}

struct response *upload_begin(struct api *api, struct request *r) {
    struct response *refusal = check_request(r);
    if (!refusal)
        refusal = limits_check_upload(api, r, r->content_length > 0 ? (uint64_t)r->content_length : 0);
    if (!refusal)
        refusal = space_check_room(api, r, r->content_length > 0 ? (uint64_t)r->content_length : 0);
    if (!refusal)
        refusal = space_check_share(api, r, NULL, r->content_length > 0 ? (uint64_t)r->content_length : 0);
    if (refusal)
        return refusal;
    struct error err;
    struct upload *u = mem_calloc(1, sizeof *u);
    sha256_init(&u->hash);
    u->path = file_join(api->config.data_dir, "uploads/XXXXXX");
    u->fd = mkostemp(u->path, O_CLOEXEC);
    if (u->fd < 0) {
        error_set_errno(&err, errno, "cannot create a file in %s/uploads", api->config.data_dir);
        mem_free(u->path);
        u->path = NULL;
        upload_free(u);
        return problem_from(r, &err);
    }
    r->upload = u;
    if (r->content_length > 0) {
        u->is_reserved = fallocate(u->fd, FALLOC_FL_KEEP_SIZE, 0, (off_t)r->content_length) == 0;
        if (!u->is_reserved && (errno == ENOSPC || errno == EDQUOT)) {
            error_set_errno(&err, errno, "cannot reserve %lld bytes for the upload",
                            (long long)r->content_length);
            return problem_from(r, &err);
        }
    }
    return NULL;
}

struct response *upload_data(struct api *api, struct request *r, const void *data, size_t length) {
    struct upload *u = r->upload;
    struct error err;
    if (file_write_all(u->fd, data, length, "the upload", &err) != STATUS_OK)
        return problem_from(r, &err);
    sha256_update(&u->hash, data, length);
    u->bytes += length;
    atomic_fetch_add(&api->uploaded_bytes, length);
    if (u->bytes - u->step_start < STEP_BYTES)
        return NULL;
    /* Only a hint to the kernel; the sync at the end is what counts. */
    (void)sync_file_range(u->fd, (off_t)u->step_start, (off_t)(u->bytes - u->step_start),
                          SYNC_FILE_RANGE_WRITE);
    u->step_start = u->bytes;
    if (u->is_reserved)
        return NULL;
    struct response *refusal = space_check_room(api, r, 0);
    return refusal ? refusal : space_check_share(api, r, NULL, u->bytes);
}

struct response *upload_seal(struct api *api, struct request *r, char id[SHA256_HEX_SIZE]) {
    (void)api;
    struct upload *u = r->upload;
    struct error err;
    const char *sha256 = request_field(r, "X-Content-SHA256");
    const char *digest = request_field(r, "Repr-Digest");
    char wanted[SHA256_HEX_SIZE];
    sha256_hex(&u->hash, id);
    if (sha256 && strcasecmp(sha256, id) != 0)
        return problem(r, 422, "the body's SHA-256 is %s, and X-Content-SHA256 says %s", id, sha256);
    if (digest && field_digest(digest, wanted) && strcmp(wanted, id) != 0)
        return problem(r, 422, "the body's SHA-256 is %s, and Repr-Digest says %s", id, wanted);
    if (u->bytes == 0)
        return problem(r, 400, "the body, an archive of the bundle, is empty");
    if (fsync(u->fd) == 0)
        return NULL;
    error_set_errno(&err, errno, "cannot sync the upload");
    return problem_from(r, &err);
}

enum status upload_sync_place(struct api *api, const char *id, struct error *err) {
    char *dir = mem_printf("%s/scenes/%s", api->config.data_dir, id);
    char *archive = file_join(dir, "archive");
    enum status status = file_sync_parent(archive, err);
    if (status == STATUS_OK)
        status = file_sync_parent(dir, err);
    mem_free(archive);
    mem_free(dir);
    return status;
}

enum status upload_place(struct api *api, const char *path, const char *id, struct error *err) {
    char *dir = mem_printf("%s/scenes/%s", api->config.data_dir, id);
    char *archive = file_join(dir, "archive");
    enum status status = file_make_dirs(dir, err);
    if (status == STATUS_OK && chmod(path, 0400) != 0)
        status = error_set_errno(err, errno, "cannot set the mode of %s", path);
    if (status == STATUS_OK && rename(path, archive) != 0)
        status = error_set_errno(err, errno, "cannot move the upload to %s", archive);
    mem_free(archive);
    mem_free(dir);
    return status == STATUS_OK ? upload_sync_place(api, id, err) : status;
}

enum status upload_publish(struct api *api, struct upload *u, const char *id, struct error *err) {
    enum status status = upload_place(api, u->path, id, err);
    if (status == STATUS_OK) {
        mem_free(u->path);
        u->path = NULL;
    }
    return status;
}
