/* upload_writer.c -- see upload_writer.h. */
#include "server/uploads/upload_writer.h"

#include <errno.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/mem.h"
#include "server/uploads/upload_session.h"

#define COMMIT_BYTES ((uint64_t)64 << 20) /* counted at least this often; after a kill this much is hashed again */
#define HINT_BYTES ((uint64_t)8 << 20)    /* write-back is started this often, so that commits are short */

struct upload_writer {
    struct upload_session *session;
    bool is_checked;
    uint64_t at;        /* next offset to write */
    struct sha256 hash; /* with is_checked: up to `at` */
};

static enum status lost(struct error *err) {
    error_set(err, STATUS_CONFLICT, "the disk failed: the upload's offset is now an earlier one");
    return error_hint(err, "HEAD gives the offset; continue from there");
}

/* --- who writes ------------------------------------------------------------------------------ */

/* The session's mutex is held. */
static enum status check_offset(const struct upload_session *s, uint64_t offset, struct error *err) {
    if (!s->is_loaded) /* s->hash would still include dropped bytes */
        return lost(err);
    if (s->received != offset)
        return error_set(err, STATUS_CONFLICT, "the upload's offset is %llu, not %llu", (unsigned long long)s->received,
                         (unsigned long long)offset);
    return STATUS_OK;
}

enum status upload_writer_take(struct resumables *r, const char *id, uint64_t offset, bool is_checked,
                               struct upload_writer **out, struct error *err) {
    struct upload_session *s;
    *out = NULL;
    enum status status = upload_session_get(r, id, &s, err);
    if (status != STATUS_OK)
        return status;
    pthread_mutex_lock(&s->mutex);
    bool must_distrust = is_checked && s->tail_is_trusted;
    pthread_mutex_unlock(&s->mutex);
    if (must_distrust)
        status = upload_session_distrust_tail(s, err);
    pthread_mutex_lock(&s->mutex);
    if (status == STATUS_OK)
        status = check_offset(s, offset, err);
    if (status == STATUS_OK) {
        struct upload_writer *w = *out = mem_calloc(1, sizeof *w);
        *w = (struct upload_writer){s, is_checked, offset, s->hash};
        s->writer = w;
    }
    pthread_mutex_unlock(&s->mutex);
    if (status != STATUS_OK)
        upload_session_put(s);
    return status;
}

/* The session's mutex is held. */
static enum status check_is_writer(const struct upload_writer *w, struct error *err) {
    if (w->session->is_gone)
        return error_set(err, STATUS_NOT_FOUND, "the upload was removed");
    if (w->session->writer != w)
        return error_set(err, STATUS_CONFLICT, "another request continues this upload");
    return STATUS_OK;
}

void upload_writer_release(struct upload_writer *w) {
    if (!w)
        return;
    struct upload_session *s = w->session;
    pthread_mutex_lock(&s->mutex);
    if (s->writer == w)
        s->writer = NULL;
    pthread_mutex_unlock(&s->mutex);
    upload_session_put(s);
    mem_free(w);
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

/* Starts write-back of what has arrived up to `at`; only a hint to the kernel. */
static void hint(struct upload_session *s, uint64_t at) {
    if (at >= s->hinted && at - s->hinted < HINT_BYTES)
        return;
    if (at > s->hinted)
        (void)sync_file_range(s->fd, (off_t)s->hinted, (off_t)(at - s->hinted), SYNC_FILE_RANGE_WRITE);
    s->hinted = at;
}

enum status upload_writer_write(struct upload_writer *w, const void *data, uint64_t length, struct error *err) {
    struct upload_session *s = w->session;
    pthread_mutex_lock(&s->mutex);
    enum status status = check_is_writer(w, err);
    if (status == STATUS_OK && length > s->length - w->at)
        status = error_set(err, STATUS_LIMIT, "the upload has %llu bytes, and more were sent",
                           (unsigned long long)s->length);
    if (status == STATUS_OK)
        status = write_at(s->fd, data, length, w->at, err);
    if (status == STATUS_OK) {
        sha256_update(&w->hash, data, length);
        w->at += length;
        if (!w->is_checked) {
            s->hash = w->hash;
            s->received = w->at;
        }
        hint(s, w->at);
    }
    pthread_mutex_unlock(&s->mutex);
    return status;
}

uint64_t upload_writer_room(const struct upload_writer *w) {
    return w->session->length - w->at; /* the length never changes */
}

uint64_t upload_writer_unreserved(const struct upload_writer *w) {
    struct stat info;
    uint64_t length = w->session->length;
    if (fstat(w->session->fd, &info) != 0)
        return upload_writer_room(w);
    uint64_t has = (uint64_t)info.st_blocks * 512;
    return has < length ? length - has : 0;
}

/* --- counting ------------------------------------------------------------------------------ */

bool upload_writer_is_due(const struct upload_writer *w) {
    struct upload_session *s = w->session;
    pthread_mutex_lock(&s->mutex);
    bool due = s->received - s->counted >= COMMIT_BYTES;
    pthread_mutex_unlock(&s->mutex);
    return due;
}

enum status upload_writer_accept(struct upload_writer *w, struct error *err) {
    struct upload_session *s = w->session;
    pthread_mutex_lock(&s->mutex);
    enum status status = check_is_writer(w, err);
    if (status == STATUS_OK) {
        s->hash = w->hash;
        s->received = w->at;
    }
    pthread_mutex_unlock(&s->mutex);
    return status;
}

enum status upload_writer_commit(struct upload_writer *w, struct error *err) {
    return upload_session_commit(w->session, err);
}

enum status upload_writer_finish(struct upload_writer *w, struct upload_row *row, struct error *err) {
    struct upload_session *s = w->session;
    enum status status = resumable_status(s->resumables, s->id, row, err);
    if (status != STATUS_OK || row->received >= w->at)
        return status;
    upload_row_release(row); /* another thread's sync has failed */
    return lost(err);
}
