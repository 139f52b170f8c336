/* upload_writer.c -- see upload_writer.h. */
#include "server/uploads/upload_writer.h"

#include <errno.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/mem.h"
#include "server/uploads/upload_session.h"

#define COMMIT_BYTES ((uint64_t)64 << 20) /* counted at least so often; a kill costs hashing them again */
#define HINT_BYTES ((uint64_t)8 << 20)    /* writing out begins so often, so that a commit is short */

struct upload_writer {
    struct upload_session *session;
    bool is_checked;
    uint64_t at;        /* where it writes next */
    struct sha256 hash; /* where is_checked: up to `at` */
};

static enum status lost(struct error *err) {
    error_set(err, STATUS_CONFLICT, "the disk failed: the upload's offset is now an earlier one");
    return error_hint(err, "HEAD gives the offset; continue from there");
}

/* --- who writes ---------------------------------------------------------------------------- */

/* The session's mutex is held. */
static enum status check_offset(const struct upload_session *e, uint64_t offset, struct error *err) {
    if (!e->is_loaded) /* e->hash is still that of what was forgotten */
        return lost(err);
    if (e->received != offset)
        return error_set(err, STATUS_CONFLICT, "the upload's offset is %llu, not %llu",
                         (unsigned long long)e->received, (unsigned long long)offset);
    return STATUS_OK;
}

enum status upload_writer_take(struct resumables *p, const char *id, uint64_t offset, bool is_checked, struct upload_writer **out,
                       struct error *err) {
    struct upload_session *e;
    *out = NULL;
    enum status status = upload_session_get(p, id, &e, err);
    if (status != STATUS_OK)
        return status;
    pthread_mutex_lock(&e->mutex);
    bool must_distrust = is_checked && e->tail_is_trusted;
    pthread_mutex_unlock(&e->mutex);
    if (must_distrust)
        status = upload_session_distrust_tail(e, err);
    pthread_mutex_lock(&e->mutex);
    if (status == STATUS_OK)
        status = check_offset(e, offset, err);
    if (status == STATUS_OK) {
        struct upload_writer *c = *out = mem_calloc(1, sizeof *c);
        *c = (struct upload_writer){e, is_checked, offset, e->hash};
        e->holder = c;
    }
    pthread_mutex_unlock(&e->mutex);
    if (status != STATUS_OK)
        upload_session_put(e);
    return status;
}

/* The session's mutex is held. */
static enum status check_holder(const struct upload_writer *c, struct error *err) {
    if (c->session->is_gone)
        return error_set(err, STATUS_NOT_FOUND, "the upload was removed");
    if (c->session->holder != c)
        return error_set(err, STATUS_CONFLICT, "another request continues this upload");
    return STATUS_OK;
}

void upload_writer_release(struct upload_writer *c) {
    if (!c)
        return;
    struct upload_session *e = c->session;
    pthread_mutex_lock(&e->mutex);
    if (e->holder == c)
        e->holder = NULL;
    pthread_mutex_unlock(&e->mutex);
    upload_session_put(e);
    mem_free(c);
}

/* --- writing ------------------------------------------------------------------------------- */

static enum status write_at(int fd, const char *data, uint64_t length, uint64_t at, struct error *err) {
    while (length > 0) {
        ssize_t wrote = pwrite(fd, data, length, (off_t)at);
        if (wrote < 0 && errno == EINTR)
            continue;
        if (wrote < 0)
            return error_set_errno(err, errno, "cannot write the upload");
        data += wrote;
        at += (uint64_t)wrote;
        length -= (uint64_t)wrote;
    }
    return STATUS_OK;
}

/* Now and then: the kernel begins to write out what has come up to `at`. Only a hint to it. */
static void hint(struct upload_session *e, uint64_t at) {
    if (at >= e->hinted && at - e->hinted < HINT_BYTES)
        return;
    if (at > e->hinted)
        (void)sync_file_range(e->fd, (off_t)e->hinted, (off_t)(at - e->hinted), SYNC_FILE_RANGE_WRITE);
    e->hinted = at;
}

enum status upload_writer_write(struct upload_writer *c, const void *data, uint64_t length, struct error *err) {
    struct upload_session *e = c->session;
    pthread_mutex_lock(&e->mutex);
    enum status status = check_holder(c, err);
    if (status == STATUS_OK && length > e->length - c->at)
        status = error_set(err, STATUS_LIMIT, "the upload has %llu bytes, and more were sent",
                           (unsigned long long)e->length);
    if (status == STATUS_OK)
        status = write_at(e->fd, data, length, c->at, err);
    if (status == STATUS_OK) {
        sha256_update(&c->hash, data, length);
        c->at += length;
        if (!c->is_checked) {
            e->hash = c->hash;
            e->received = c->at;
        }
        hint(e, c->at);
    }
    pthread_mutex_unlock(&e->mutex);
    return status;
}

uint64_t upload_writer_room(const struct upload_writer *c) {
    return c->session->length - c->at; /* the length never changes */
}

uint64_t upload_writer_unreserved(const struct upload_writer *c) {
    struct stat info;
    uint64_t length = c->session->length;
    if (fstat(c->session->fd, &info) != 0)
        return upload_writer_room(c);
    uint64_t has = (uint64_t)info.st_blocks * 512;
    return has < length ? length - has : 0;
}

/* --- counting ------------------------------------------------------------------------------ */

bool upload_writer_is_due(const struct upload_writer *c) {
    struct upload_session *e = c->session;
    pthread_mutex_lock(&e->mutex);
    bool due = e->received - e->counted >= COMMIT_BYTES;
    pthread_mutex_unlock(&e->mutex);
    return due;
}

enum status upload_writer_accept(struct upload_writer *c, struct error *err) {
    struct upload_session *e = c->session;
    pthread_mutex_lock(&e->mutex);
    enum status status = check_holder(c, err);
    if (status == STATUS_OK) {
        e->hash = c->hash;
        e->received = c->at;
    }
    pthread_mutex_unlock(&e->mutex);
    return status;
}

enum status upload_writer_commit(struct upload_writer *c, struct error *err) {
    return upload_session_commit(c->session, err);
}

enum status upload_writer_finish(struct upload_writer *c, struct upload_row *row, struct error *err) {
    struct upload_session *e = c->session;
    enum status status = resumable_status(e->resumables, e->id, row, err);
    if (status != STATUS_OK || row->received >= c->at)
        return status;
    upload_row_release(row); /* another thread's sync has failed */
    return lost(err);
}
