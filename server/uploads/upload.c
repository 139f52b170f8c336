/* upload.c -- see upload.h. */
#include "server/uploads/upload.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/file.h"
#include "common/mem.h"
#include "server/data/layout.h"

/* After each step, start write-back, so that the final sync is short, and check whether others have filled the disk. */
#define STEP_BYTES ((uint64_t)32 << 20)

struct upload {
    int fd;
    char *path; /* NULL once published */
    struct sha256 hash;
    uint64_t bytes;
    uint64_t step_start; /* where the current step began */
    bool is_reserved;    /* all of its space is allocated */
};

uint64_t upload_bytes(const struct upload *u) { return u->bytes; }

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

enum status upload_new(struct upload **out, const char *data_dir, uint64_t length, struct error *err) {
    struct upload *u = *out = mem_calloc(1, sizeof *u);
    sha256_init(&u->hash);
    u->path = layout_upload(data_dir, LAYOUT_RANDOM);
    u->fd = mkostemp(u->path, O_CLOEXEC);
    enum status status = STATUS_OK;
    if (u->fd < 0) {
        char *folder = layout_uploads(data_dir);
        status = error_set_errno(err, errno, "cannot create a file in %s", folder);
        mem_free(folder);
        mem_free(u->path);
        u->path = NULL;
    } else if (length > 0) {
        u->is_reserved = fallocate(u->fd, FALLOC_FL_KEEP_SIZE, 0, (off_t)length) == 0;
        if (!u->is_reserved && (errno == ENOSPC || errno == EDQUOT))
            status =
                error_set_errno(err, errno, "cannot reserve %llu bytes for the upload", (unsigned long long)length);
    }
    if (status == STATUS_OK)
        return STATUS_OK;
    upload_free(u);
    *out = NULL;
    return status;
}

enum status upload_write(struct upload *u, const void *data, size_t length, bool *must_check_room, struct error *err) {
    *must_check_room = false;
    enum status status = file_write_all(u->fd, data, length, "the upload", err);
    if (status != STATUS_OK)
        return status;
    sha256_update(&u->hash, data, length);
    u->bytes += length;
    if (u->bytes - u->step_start < STEP_BYTES)
        return STATUS_OK;
    /* Only a hint to the kernel; the final sync is what counts. */
    (void)sync_file_range(u->fd, (off_t)u->step_start, (off_t)(u->bytes - u->step_start), SYNC_FILE_RANGE_WRITE);
    u->step_start = u->bytes;
    *must_check_room = !u->is_reserved;
    return STATUS_OK;
}

void upload_digest(struct upload *u, char hex[SHA256_HEX_SIZE]) { sha256_hex(&u->hash, hex); }

enum status upload_sync(struct upload *u, struct error *err) {
    return fsync(u->fd) == 0 ? STATUS_OK : error_set_errno(err, errno, "cannot sync the upload");
}

enum status upload_sync_place(const char *data_dir, const char *id, struct error *err) {
    char *dir = layout_scene(data_dir, id);
    char *archive = layout_archive(dir);
    enum status status = file_sync_parent(archive, err);
    if (status == STATUS_OK)
        status = file_sync_parent(dir, err);
    mem_free(archive);
    mem_free(dir);
    return status;
}

enum status upload_place(const char *data_dir, const char *path, const char *id, struct error *err) {
    char *dir = layout_scene(data_dir, id);
    char *archive = layout_archive(dir);
    enum status status = file_make_dirs(dir, err);
    if (status == STATUS_OK && chmod(path, 0400) != 0)
        status = error_set_errno(err, errno, "cannot set the mode of %s", path);
    if (status == STATUS_OK && rename(path, archive) != 0)
        status = error_set_errno(err, errno, "cannot move the upload to %s", archive);
    mem_free(archive);
    mem_free(dir);
    return status == STATUS_OK ? upload_sync_place(data_dir, id, err) : status;
}

enum status upload_publish(struct upload *u, const char *data_dir, const char *id, struct error *err) {
    enum status status = upload_place(data_dir, u->path, id, err);
    if (status == STATUS_OK) {
        mem_free(u->path);
        u->path = NULL;
    }
    return status;
}
