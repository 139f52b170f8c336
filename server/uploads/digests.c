/* digests.c -- see digests.h. */
#include "server/uploads/digests.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "common/background.h"
#include "common/clock.h"
#include "common/log.h"
#include "common/mem.h"
#include "server/data/work_file.h"

#define CHUNK_BYTES ((size_t)256 << 10) /* read at once */
#define RETRY_SEC 10                    /* after the store could not be read or written */

struct digests {
    struct store *store;
    const char *data_dir;
    atomic_ullong hashed_bytes;
    struct background thread; /* its mutex guards what follows */
    bool has_work;            /* a digest may have been requested since the last search */
    bool is_idle;             /* nothing was found, or nothing can be done for now */
};

/* --- one file ---------------------------------------------------------------------------- */

static int64_t nanoseconds(struct timespec t) { return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec; }

static enum status look(int fd, struct file_version *v, struct error *err) {
    struct stat info;
    if (fstat(fd, &info) != 0)
        return error_set_errno(err, errno, "cannot access an output");
    if (!S_ISREG(info.st_mode))
        return error_set(err, STATUS_CORRUPT, "an output is not a plain file");
    *v = (struct file_version){info.st_ino, (uint64_t)info.st_size, nanoseconds(info.st_mtim),
                               nanoseconds(info.st_ctim)};
    return STATUS_OK;
}

static bool is_same_version(const struct file_version *a, const struct file_version *b) {
    return a->inode == b->inode && a->bytes == b->bytes && a->modified_ns == b->modified_ns &&
           a->changed_ns == b->changed_ns;
}

static enum status hash(int fd, uint64_t bytes, const atomic_bool *stopping, char hex[SHA256_HEX_SIZE],
                        struct error *err) {
    struct sha256 state;
    char *chunk = mem_alloc(CHUNK_BYTES);
    enum status status = STATUS_OK;
    sha256_init(&state);
    for (uint64_t at = 0; at < bytes && status == STATUS_OK;) {
        uint64_t left = bytes - at;
        ssize_t got = pread(fd, chunk, left < CHUNK_BYTES ? (size_t)left : CHUNK_BYTES, (off_t)at);
        if (got < 0 && errno == EINTR)
            continue;
        if (got < 0)
            status = error_set_errno(err, errno, "cannot read an output");
        else if (got == 0)
            status = error_set(err, STATUS_UNAVAILABLE, "the file shrank while it was read");
        else if (stopping && atomic_load(stopping))
            status = error_set(err, STATUS_CANCELLED, "the daemon is stopping");
        else
            sha256_update(&state, chunk, (size_t)got);
        at += got > 0 ? (uint64_t)got : 0;
    }
    sha256_hex(&state, hex);
    mem_free(chunk);
    return status;
}

enum status digests_hash(int fd, const atomic_bool *stopping, struct file_version *version, char hex[SHA256_HEX_SIZE],
                         struct error *err) {
    struct file_version before;
    enum status status = look(fd, &before, err);
    if (status == STATUS_OK)
        status = hash(fd, before.bytes, stopping, hex, err);
    if (status == STATUS_OK)
        status = look(fd, version, err);
    /* Compare without the change time: a rename over the name changes that, not the content. */
    if (status == STATUS_OK && (version->bytes != before.bytes || version->modified_ns != before.modified_ns))
        status = error_set(err, STATUS_UNAVAILABLE, "the file changed while it was read");
    return status;
}

/* A hash: the numbers themselves (the inode) are not for the public. */
static void make_tag(const char *thing, const char *name, const struct file_version *v, char tag[33]) {
    char hex[SHA256_HEX_SIZE];
    char *text = mem_printf("%s %s %llu %llu %lld %lld", thing, name, (unsigned long long)v->inode,
                            (unsigned long long)v->bytes, (long long)v->modified_ns, (long long)v->changed_ns);
    sha256_of(text, strlen(text), hex);
    snprintf(tag, 33, "%.32s", hex);
    mem_free(text);
}

enum status digests_identify(struct digests *d, int64_t job_id, const struct output_row *row, int fd,
                             struct digests_file *file, struct error *err) {
    struct file_version v;
    *file = (struct digests_file){0};
    enum status status = look(fd, &v, err);
    if (status != STATUS_OK)
        return status;
    bool is_known = *row->digest && is_same_version(&row->version, &v);
    if (is_known) {
        memcpy(file->hex, row->digest, sizeof file->hex);
    } else if (v.bytes <= DIGESTS_AT_ONCE) {
        status = digests_hash(fd, NULL, &v, file->hex, err);
    } else {
        struct error why; /* a full disk, for example: the digest stays requested */
        if (store_output_want_digest(d->store, job_id, row->name, &why) != STATUS_OK)
            log_debug("job %lld: %s is not hashed: %s", (long long)job_id, row->name, why.message);
    }
    char job[24];
    snprintf(job, sizeof job, "%lld", (long long)job_id);
    file->bytes = v.bytes;
    make_tag(job, row->name, &v, file->tag);
    return status;
}

enum status digests_identify_file(int fd, const char *thing, const char *name, struct digests_file *file,
                                  struct error *err) {
    struct file_version v;
    *file = (struct digests_file){0};
    enum status status = look(fd, &v, err);
    if (status == STATUS_OK && v.bytes <= DIGESTS_AT_ONCE)
        status = digests_hash(fd, NULL, &v, file->hex, err);
    file->bytes = v.bytes;
    make_tag(thing, name, &v, file->tag);
    return status;
}

/* --- the thread -------------------------------------------------------------------------- */

/* Hashes an output's current version; *is_had: there is a digest. false when the daemon stops. */
static bool compute(struct digests *d, int64_t job_id, const struct output_row *row, struct file_version *version,
                    char hex[SHA256_HEX_SIZE], bool *is_had) {
    struct error err;
    int fd;
    enum status status = work_file_open_output(d->data_dir, job_id, row->attempt, row->name, &fd, &err);
    if (status == STATUS_OK) {
        status = digests_hash(fd, &d->thread.stopping, version, hex, &err);
        close(fd);
    }
    *is_had = status == STATUS_OK;
    if (*is_had)
        atomic_fetch_add(&d->hashed_bytes, version->bytes);
    else if (status != STATUS_CANCELLED && status != STATUS_UNAVAILABLE && status != STATUS_NOT_FOUND)
        log_warning("job %lld: %s has no digest: %s", (long long)job_id, row->name, err.message);
    return status != STATUS_CANCELLED;
}

/* Waits for a new request, or (retries) for a while; false when the daemon stops. */
static bool wait_for_work(struct digests *d, bool retries) {
    double until_sec = clock_sec() + RETRY_SEC;
    pthread_mutex_lock(&d->thread.mutex);
    d->is_idle = !d->has_work || retries;
    pthread_cond_broadcast(&d->thread.changed);
    bool goes_on = true;
    while (!atomic_load(&d->thread.stopping) && goes_on && (retries || !d->has_work)) {
        if (retries)
            goes_on = background_wait_until(&d->thread, until_sec);
        else
            pthread_cond_wait(&d->thread.changed, &d->thread.mutex);
    }
    d->has_work = d->is_idle = false;
    pthread_mutex_unlock(&d->thread.mutex);
    return !atomic_load(&d->thread.stopping);
}

/* Hashes one output and enters the result, repeatedly if needed; false when the daemon stops. */
static bool work_on(struct digests *d, int64_t job_id, const struct output_row *row) {
    struct file_version version;
    char hex[SHA256_HEX_SIZE];
    struct error err;
    bool is_had, goes_on = compute(d, job_id, row, &version, hex, &is_had);
    while (goes_on && store_output_enter_digest(d->store, job_id, row, is_had ? &version : NULL, is_had ? hex : NULL,
                                                &err) != STATUS_OK) {
        log_warning("job %lld: the digest of %s cannot be kept: %s", (long long)job_id, row->name, err.message);
        goes_on = wait_for_work(d, true);
    }
    return goes_on;
}

static void *run(void *user) {
    struct digests *d = user;
    bool goes_on = true;
    pthread_setname_np(pthread_self(), "digests");
    while (goes_on && !atomic_load(&d->thread.stopping)) {
        struct output_row row;
        struct error err;
        int64_t job_id;
        enum status status = store_output_next_digest(d->store, &job_id, &row, &err);
        if (status == STATUS_OK)
            goes_on = work_on(d, job_id, &row);
        else if (status != STATUS_NOT_FOUND)
            log_warning("cannot look for outputs that have no digest: %s", err.message);
        output_row_release(&row);
        if (goes_on && status != STATUS_OK)
            goes_on = wait_for_work(d, status != STATUS_NOT_FOUND);
    }
    return NULL;
}

enum status digests_new(struct digests **out, struct store *store, const char *data_dir, struct error *err) {
    struct digests *d = mem_calloc(1, sizeof *d);
    d->store = store;
    d->data_dir = data_dir;
    enum status status = background_start(&d->thread, run, d, "hashes outputs", err);
    *out = status == STATUS_OK ? d : NULL;
    if (status != STATUS_OK)
        mem_free(d);
    return status;
}

void digests_free(struct digests *d) {
    if (!d)
        return;
    background_stop(&d->thread);
    mem_free(d);
}

void digests_wake(void *digests) {
    struct digests *d = digests;
    pthread_mutex_lock(&d->thread.mutex);
    d->has_work = true;
    pthread_cond_broadcast(&d->thread.changed);
    pthread_mutex_unlock(&d->thread.mutex);
}

uint64_t digests_hashed_bytes(const struct digests *d) { return atomic_load(&d->hashed_bytes); }

void digests_wait(struct digests *d) {
    pthread_mutex_lock(&d->thread.mutex);
    while (d->has_work || !d->is_idle)
        pthread_cond_wait(&d->thread.changed, &d->thread.mutex);
    pthread_mutex_unlock(&d->thread.mutex);
}
