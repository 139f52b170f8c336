/* upload_session.c -- see upload_session.h.
 *
 * One commit of an upload at a time: of two syncs at once the kernel tells one of a page that it could
 * not write, and the other that all is well. */
#include "server/uploads/upload_session.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "common/log.h"
#include "common/mem.h"
#include "server/data/layout.h"

#define CHUNK_BYTES ((size_t)256 << 10) /* read at once */

char *upload_session_path(const struct resumables *r, const char *id) {
    return layout_upload(r->config.folder->dir, id);
}

/* --- loading ------------------------------------------------------------------------------- */

static enum status open_file(struct upload_session *s, struct error *err) {
    if (s->fd >= 0)
        return STATUS_OK;
    enum status status = STATUS_OK;
    char *path = upload_session_path(s->resumables, s->id);
    s->fd = open(path, O_RDWR | O_CLOEXEC | O_NOFOLLOW);
    /* a complete file may have moved to the scenes: see place in resumable.c */
    if (s->fd < 0 && (errno != ENOENT || s->received < s->length))
        status = error_set_errno(err, errno, "cannot open %s", path);
    mem_free(path);
    return status;
}

/* Hashes what lies in the file beyond s->received: written, but never counted. */
static enum status count_tail(struct upload_session *s, struct error *err) {
    char *chunk = mem_alloc(CHUNK_BYTES);
    enum status status = STATUS_OK;
    ssize_t got = 1;
    while (got != 0 && s->received < s->length) {
        uint64_t left = s->length - s->received;
        got = pread(s->fd, chunk, left < CHUNK_BYTES ? (size_t)left : CHUNK_BYTES, (off_t)s->received);
        if (got < 0 && errno == EINTR)
            continue;
        if (got < 0) {
            status = error_set_errno(err, errno, "cannot read upload %s", s->id);
            break;
        }
        sha256_update(&s->hash, chunk, (size_t)got);
        s->received += (uint64_t)got;
    }
    mem_free(chunk);
    return status;
}

/* Truncates to the counted bytes: what follows is undefined after a reboot or a disk error. */
static enum status cut_tail(struct upload_session *s, struct error *err) {
    if (ftruncate(s->fd, (off_t)s->received) != 0)
        return error_set_errno(err, errno, "cannot truncate upload %s", s->id);
    if (fallocate(s->fd, FALLOC_FL_KEEP_SIZE, 0, (off_t)s->length) != 0 && errno != EOPNOTSUPP)
        return error_set_errno(err, errno, "cannot reserve %llu bytes for upload %s", (unsigned long long)s->length,
                               s->id);
    return store_upload_begin(s->resumables->config.store, s->id, s->resumables->boot, err);
}

static enum status load(struct upload_session *s, struct error *err) {
    struct resumables *r = s->resumables;
    struct upload_row row;
    enum status status = store_upload_get(r->config.store, s->id, &row, &s->hash, sizeof s->hash, err);
    if (status != STATUS_OK)
        return status;
    bool is_same_boot = strcmp(row.boot, r->boot) == 0;
    s->length = row.length;
    s->received = s->counted = s->hinted = row.received;
    s->tail_is_trusted = *row.boot != '\0';
    status = *row.scene_id ? error_set(err, STATUS_CONFLICT, "upload %s is finished", s->id) : open_file(s, err);
    if (status == STATUS_OK && s->fd >= 0 && s->tail_is_trusted)
        status = is_same_boot && !s->needs_truncation ? count_tail(s, err) : cut_tail(s, err);
    if (status == STATUS_OK) {
        s->needs_truncation = false;
        s->is_loaded = true;
    }
    upload_row_release(&row);
    return status;
}

/* --- while it is in use -------------------------------------------------------------------- */

void upload_session_drop(struct upload_session *s) {
    struct upload_session **link = &s->resumables->first;
    while (*link != s)
        link = &(*link)->next;
    *link = s->next;
    if (s->fd >= 0)
        close(s->fd);
    pthread_mutex_destroy(&s->mutex);
    pthread_mutex_destroy(&s->syncing);
    mem_free(s);
}

static bool is_clean(struct upload_session *s) {
    pthread_mutex_lock(&s->mutex);
    bool clean = s->is_gone || (!s->needs_truncation && (!s->is_loaded || s->received == s->counted));
    pthread_mutex_unlock(&s->mutex);
    return clean;
}

void upload_session_put(struct upload_session *s) {
    struct resumables *r = s->resumables;
    pthread_mutex_lock(&r->mutex);
    if (--s->users == 0 && is_clean(s))
        upload_session_drop(s);
    pthread_mutex_unlock(&r->mutex);
}

static struct upload_session *find(struct resumables *r, const char *id) {
    struct upload_session *s = r->first;
    while (s && strcmp(s->id, id) != 0)
        s = s->next;
    return s;
}

static struct upload_session *add(struct resumables *r, const char *id) {
    struct upload_session *s = mem_calloc(1, sizeof *s);
    snprintf(s->id, sizeof s->id, "%s", id);
    s->resumables = r;
    s->fd = -1;
    pthread_mutex_init(&s->syncing, NULL);
    pthread_mutex_init(&s->mutex, NULL);
    s->next = r->first;
    r->first = s;
    return s;
}

enum status upload_session_get(struct resumables *r, const char *id, struct upload_session **out, struct error *err) {
    pthread_mutex_lock(&r->mutex);
    struct upload_session *s = find(r, id);
    if (!s)
        s = add(r, id);
    s->users++;
    pthread_mutex_unlock(&r->mutex);
    enum status status = STATUS_OK;
    pthread_mutex_lock(&s->mutex);
    if (s->is_gone)
        status = error_set(err, STATUS_NOT_FOUND, "there is no upload %s", id);
    else if (!s->is_loaded)
        status = load(s, err);
    pthread_mutex_unlock(&s->mutex);
    if (status != STATUS_OK)
        upload_session_put(s);
    *out = status == STATUS_OK ? s : NULL;
    return status;
}

struct upload_session *upload_session_next(struct resumables *r, unsigned long round) {
    pthread_mutex_lock(&r->mutex);
    struct upload_session *s = r->first;
    while (s && (s->users > 0 || s->visited == round))
        s = s->next;
    if (s) {
        s->users++;
        s->visited = round;
    }
    pthread_mutex_unlock(&r->mutex);
    return s;
}

void upload_session_mark_gone(struct resumables *r, const char *id) {
    pthread_mutex_lock(&r->mutex);
    struct upload_session *s = find(r, id);
    if (s)
        s->users++;
    pthread_mutex_unlock(&r->mutex);
    if (!s)
        return;
    pthread_mutex_lock(&s->mutex);
    s->is_gone = true;
    pthread_mutex_unlock(&s->mutex);
    upload_session_put(s);
}

bool upload_session_is_whole(struct upload_session *s) {
    pthread_mutex_lock(&s->mutex);
    bool is_whole = !s->is_gone && s->counted == s->length;
    pthread_mutex_unlock(&s->mutex);
    return is_whole;
}

enum status upload_session_shrink(struct upload_session *s, struct error *err) {
    enum status status = STATUS_OK;
    pthread_mutex_lock(&s->mutex);
    /* To the size that it has: what fallocate has set aside beyond it goes. */
    if (!s->is_gone && !s->writer && s->fd >= 0 && ftruncate(s->fd, (off_t)s->received) != 0)
        status = error_set_errno(err, errno, "cannot give back the space of upload %s", s->id);
    pthread_mutex_unlock(&s->mutex);
    return status;
}

void upload_session_close(struct upload_session *s) {
    pthread_mutex_lock(&s->mutex);
    s->is_loaded = false; /* the next user reads the row again */
    s->writer = NULL;
    pthread_mutex_unlock(&s->mutex);
}

/* --- counting ------------------------------------------------------------------------------ */

/* Drops what was received since the last commit: after a failed sync the kernel may have dropped it, while the next
 * sync would succeed. The client must send it again. s->syncing is held. */
static void forget_tail(struct upload_session *s) {
    struct error err;
    pthread_mutex_lock(&s->mutex);
    s->received = s->counted;
    s->is_loaded = false; /* the next user reads row and hash again */
    s->writer = NULL;
    s->needs_truncation = ftruncate(s->fd, (off_t)s->counted) != 0 &&
                          store_upload_begin(s->resumables->config.store, s->id, "", &err) != STATUS_OK;
    if (s->needs_truncation)
        log_warning("upload %s: %s", s->id, err.message);
    pthread_mutex_unlock(&s->mutex);
}

/* s->syncing is held, so nothing else counts or forgets. */
static enum status commit_alone(struct upload_session *s, struct error *err) {
    pthread_mutex_lock(&s->mutex);
    uint64_t received = s->received;
    struct sha256 hash = s->hash;
    bool needs_truncation = s->needs_truncation && !s->is_gone, has_news = !s->is_gone && received > s->counted;
    pthread_mutex_unlock(&s->mutex);
    if (needs_truncation)
        forget_tail(s);
    if (needs_truncation || !has_news)
        return STATUS_OK;
    if (fdatasync(s->fd) != 0) {
        enum status failed = error_set_errno(err, errno, "cannot sync upload %s", s->id);
        forget_tail(s);
        return failed;
    }
    pthread_mutex_lock(&s->mutex);
    enum status status = store_upload_advance(s->resumables->config.store, s->id, received, &hash, sizeof hash, err);
    if (status == STATUS_OK)
        s->counted = received;
    pthread_mutex_unlock(&s->mutex);
    return status;
}

enum status upload_session_commit(struct upload_session *s, struct error *err) {
    pthread_mutex_lock(&s->syncing);
    enum status status = commit_alone(s, err);
    pthread_mutex_unlock(&s->syncing);
    return status;
}

enum status upload_session_distrust_tail(struct upload_session *s, struct error *err) {
    enum status status = upload_session_commit(s, err);
    if (status == STATUS_OK)
        status = store_upload_begin(s->resumables->config.store, s->id, "", err);
    pthread_mutex_lock(&s->mutex);
    if (status == STATUS_OK)
        s->tail_is_trusted = false;
    pthread_mutex_unlock(&s->mutex);
    return status;
}
