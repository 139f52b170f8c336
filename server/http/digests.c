/* digests.c -- see digests.h. */
#include "server/http/digests.h"

#include <errno.h>
#include <pthread.h>
#include <stdbool.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/mem.h"

#define ENTRY_COUNT 256 /* direct-mapped: a newer file takes the place of an older one */

/* What tells one version of a file from another. Compared member by member. */
struct version {
    dev_t device;
    ino_t inode;
    off_t size;
    struct timespec modified, changed;
};

struct digests {
    pthread_mutex_t mutex;
    struct {
        struct version version;
        char hex[SHA256_HEX_SIZE]; /* "": free */
    } entries[ENTRY_COUNT];
};

struct digests *digests_new(void) {
    struct digests *d = mem_calloc(1, sizeof *d);
    pthread_mutex_init(&d->mutex, NULL);
    return d;
}

void digests_free(struct digests *d) {
    if (!d)
        return;
    pthread_mutex_destroy(&d->mutex);
    mem_free(d);
}

static bool same_time(struct timespec a, struct timespec b) {
    return a.tv_sec == b.tv_sec && a.tv_nsec == b.tv_nsec;
}

static bool same_version(const struct version *a, const struct version *b) {
    return a->device == b->device && a->inode == b->inode && a->size == b->size &&
           same_time(a->modified, b->modified) && same_time(a->changed, b->changed);
}

static enum status look(int fd, struct version *v, struct error *err) {
    struct stat info;
    if (fstat(fd, &info) != 0)
        return error_set_errno(err, errno, "cannot look at an output");
    if (!S_ISREG(info.st_mode))
        return error_set(err, STATUS_CORRUPT, "an output is not a plain file");
    *v = (struct version){info.st_dev, info.st_ino, info.st_size, info.st_mtim, info.st_ctim};
    return STATUS_OK;
}

static enum status hash(int fd, uint64_t size, char hex[SHA256_HEX_SIZE], struct error *err) {
    struct sha256 state;
    char *chunk = mem_alloc((size_t)1 << 18);
    enum status status = STATUS_OK;
    sha256_init(&state);
    for (uint64_t at = 0; at < size;) {
        ssize_t got = pread(fd, chunk, (size_t)1 << 18, (off_t)at);
        if (got < 0 && errno == EINTR)
            continue;
        if (got <= 0) {
            status = got < 0 ? error_set_errno(err, errno, "cannot read an output")
                             : error_set(err, STATUS_UNAVAILABLE, "the file shrank while it was read");
            break;
        }
        sha256_update(&state, chunk, (size_t)got);
        at += (uint64_t)got;
    }
    sha256_hex(&state, hex);
    mem_free(chunk);
    return status;
}

enum status digests_of(struct digests *d, int fd, uint64_t *size, char hex[SHA256_HEX_SIZE],
                       struct error *err) {
    struct version before, after;
    enum status status = look(fd, &before, err);
    if (status != STATUS_OK)
        return status;
    *size = (uint64_t)before.size;
    size_t slot = (size_t)(before.inode ^ before.inode >> 8) % ENTRY_COUNT;
    pthread_mutex_lock(&d->mutex);
    bool known = *d->entries[slot].hex && same_version(&d->entries[slot].version, &before);
    if (known)
        memcpy(hex, d->entries[slot].hex, SHA256_HEX_SIZE);
    pthread_mutex_unlock(&d->mutex);
    if (known)
        return STATUS_OK;
    status = hash(fd, *size, hex, err);
    if (status == STATUS_OK)
        status = look(fd, &after, err);
    if (status != STATUS_OK)
        return status;
    /* The change time moves when a rename takes the name away, too; the content did not. */
    if (after.size != before.size || !same_time(after.modified, before.modified))
        return error_set(err, STATUS_UNAVAILABLE, "the file changed while it was read");
    pthread_mutex_lock(&d->mutex);
    d->entries[slot].version = after;
    memcpy(d->entries[slot].hex, hex, SHA256_HEX_SIZE);
    pthread_mutex_unlock(&d->mutex);
    return STATUS_OK;
}
