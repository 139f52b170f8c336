/* upload.c -- see upload.h. */
#include "server/uploads/upload.h"

#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
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
    atomic_ullong bytes; /* that have arrived; arrivals_of reads it from other threads */
    uint64_t step_start; /* where the current step began */
    bool is_reserved;    /* all of its space is allocated */
    /* Constant while it is listed: */
    int64_t user_id;
    uint64_t length; /* 0: unknown */
    /* Under the arrivals' mutex: */
    struct arrivals *arrivals; /* NULL: it is not listed */
    struct upload *next, *previous;
};

/* --- all of them -------------------------------------------------------------------------------- */

struct arrivals {
    pthread_mutex_t mutex;
    struct upload *first;
};

struct arrivals *arrivals_new(void) {
    struct arrivals *a = mem_calloc(1, sizeof *a);
    pthread_mutex_init(&a->mutex, NULL);
    return a;
}

void arrivals_free(struct arrivals *a) {
    if (a)
        pthread_mutex_destroy(&a->mutex);
    mem_free(a);
}

static void list(struct upload *u, struct arrivals *a) {
    pthread_mutex_lock(&a->mutex);
    u->arrivals = a;
    u->next = a->first;
    if (u->next)
        u->next->previous = u;
    a->first = u;
    pthread_mutex_unlock(&a->mutex);
}

static void unlist(struct upload *u) {
    struct arrivals *a = u->arrivals;
    if (!a)
        return;
    pthread_mutex_lock(&a->mutex);
    if (u->next)
        u->next->previous = u->previous;
    if (u->previous)
        u->previous->next = u->next;
    else
        a->first = u->next;
    u->arrivals = NULL;
    pthread_mutex_unlock(&a->mutex);
}

struct arrivals_sum arrivals_of(struct arrivals *a, int64_t user_id, const struct upload *but) {
    struct arrivals_sum sum = {0};
    pthread_mutex_lock(&a->mutex);
    for (const struct upload *u = a->first; u; u = u->next) {
        uint64_t bytes = upload_bytes(u);
        if (u->user_id != user_id || u == but)
            continue;
        sum.count++;
        sum.bytes += u->length > bytes ? u->length : bytes;
        sum.pledged += u->length > bytes ? u->length - bytes : 0;
    }
    pthread_mutex_unlock(&a->mutex);
    return sum;
}

/* --- one of them -------------------------------------------------------------------------------- */

uint64_t upload_bytes(const struct upload *u) { return atomic_load(&u->bytes); }

void upload_free(struct upload *u) {
    if (!u)
        return;
    unlist(u);
    if (u->fd >= 0)
        close(u->fd);
    if (u->path)
        unlink(u->path);
    mem_free(u->path);
    mem_free(u);
}

enum status upload_new(struct upload **out, struct arrivals *arrivals, int64_t user_id, const char *data_dir,
                       uint64_t length, struct error *err) {
    struct upload *u = *out = mem_calloc(1, sizeof *u);
    u->user_id = user_id;
    u->length = length;
    list(u, arrivals);
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
    uint64_t bytes = atomic_fetch_add(&u->bytes, length) + length;
    if (bytes - u->step_start < STEP_BYTES)
        return STATUS_OK;
    /* Only a hint to the kernel; the final sync is what counts. */
    (void)sync_file_range(u->fd, (off_t)u->step_start, (off_t)(bytes - u->step_start), SYNC_FILE_RANGE_WRITE);
    u->step_start = bytes;
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

/* The file is where it belongs: from here on it does not count as an arrival. */
static void let_go(struct upload *u) {
    mem_free(u->path);
    u->path = NULL;
    unlist(u);
}

enum status upload_move(struct upload *u, const char *path, struct error *err) {
    if (rename(u->path, path) != 0)
        return error_set_errno(err, errno, "cannot move the upload to %s", path);
    let_go(u);
    return file_sync_parent(path, err);
}

enum status upload_publish(struct upload *u, const char *data_dir, const char *id, struct error *err) {
    enum status status = upload_place(data_dir, u->path, id, err);
    if (status == STATUS_OK)
        let_go(u);
    return status;
}
