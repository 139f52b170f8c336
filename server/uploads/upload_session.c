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

#define CHUNK_BYTES ((size_t)256 << 10)

char *upload_session_path(const struct resumables *p, const char *id) {
    return layout_upload(p->config.folder->dir, id);
}

/* --- loading ------------------------------------------------------------------------------- */

static enum status open_file(struct upload_session *e, struct error *err) {
    if (e->fd >= 0)
        return STATUS_OK;
    enum status status = STATUS_OK;
    char *path = upload_session_path(e->resumables, e->id);
    e->fd = open(path, O_RDWR | O_CLOEXEC | O_NOFOLLOW);
    /* Whole, it may be on its way to be a scene: see place in resumable.c. */
    if (e->fd < 0 && (errno != ENOENT || e->received < e->length))
        status = error_set_errno(err, errno, "cannot open %s", path);
    mem_free(path);
    return status;
}

/* Hashes what lies in the file from e->received to its end: written, but never counted. */
static enum status count_tail(struct upload_session *e, struct error *err) {
    char *chunk = mem_alloc(CHUNK_BYTES);
    enum status status = STATUS_OK;
    ssize_t got = 1;
    while (got != 0 && e->received < e->length) {
        uint64_t left = e->length - e->received;
        got = pread(e->fd, chunk, left < CHUNK_BYTES ? (size_t)left : CHUNK_BYTES, (off_t)e->received);
        if (got < 0 && errno == EINTR)
            continue;
        if (got < 0) {
            status = error_set_errno(err, errno, "cannot read upload %s", e->id);
            break;
        }
        sha256_update(&e->hash, chunk, (size_t)got);
        e->received += (uint64_t)got;
    }
    mem_free(chunk);
    return status;
}

/* What lies beyond the counted bytes may be anything: the machine was started anew since, or its disk
 * has failed. */
static enum status cut_tail(struct upload_session *e, struct error *err) {
    if (ftruncate(e->fd, (off_t)e->received) != 0)
        return error_set_errno(err, errno, "cannot cut upload %s", e->id);
    if (fallocate(e->fd, FALLOC_FL_KEEP_SIZE, 0, (off_t)e->length) != 0 && errno != EOPNOTSUPP)
        return error_set_errno(err, errno, "cannot reserve %llu bytes for upload %s",
                               (unsigned long long)e->length, e->id);
    return store_upload_begin(e->resumables->config.store, e->id, e->resumables->boot, err);
}

static enum status load(struct upload_session *e, struct error *err) {
    struct resumables *p = e->resumables;
    struct upload_row row;
    enum status status = store_upload_get(p->config.store, e->id, &row, &e->hash, sizeof e->hash, err);
    if (status != STATUS_OK)
        return status;
    bool is_same_boot = strcmp(row.boot, p->boot) == 0;
    e->length = row.length;
    e->received = e->counted = e->hinted = row.received;
    e->tail_is_trusted = *row.boot != '\0';
    status = *row.scene_id ? error_set(err, STATUS_CONFLICT, "upload %s is finished", e->id) : open_file(e, err);
    if (status == STATUS_OK && e->fd >= 0 && e->tail_is_trusted)
        status = is_same_boot && !e->needs_truncation ? count_tail(e, err) : cut_tail(e, err);
    if (status == STATUS_OK) {
        e->needs_truncation = false;
        e->is_loaded = true;
    }
    upload_row_release(&row);
    return status;
}

/* --- while it is in use -------------------------------------------------------------------- */

void upload_session_drop(struct upload_session *e) {
    struct upload_session **link = &e->resumables->first;
    while (*link != e)
        link = &(*link)->next;
    *link = e->next;
    if (e->fd >= 0)
        close(e->fd);
    pthread_mutex_destroy(&e->mutex);
    pthread_mutex_destroy(&e->syncing);
    mem_free(e);
}

static bool is_clean(struct upload_session *e) {
    pthread_mutex_lock(&e->mutex);
    bool clean = e->is_gone || (!e->needs_truncation && (!e->is_loaded || e->received == e->counted));
    pthread_mutex_unlock(&e->mutex);
    return clean;
}

void upload_session_put(struct upload_session *e) {
    struct resumables *p = e->resumables;
    pthread_mutex_lock(&p->mutex);
    if (--e->users == 0 && is_clean(e))
        upload_session_drop(e);
    pthread_mutex_unlock(&p->mutex);
}

static struct upload_session *find(struct resumables *p, const char *id) {
    struct upload_session *e = p->first;
    while (e && strcmp(e->id, id) != 0)
        e = e->next;
    return e;
}

static struct upload_session *add(struct resumables *p, const char *id) {
    struct upload_session *e = mem_calloc(1, sizeof *e);
    snprintf(e->id, sizeof e->id, "%s", id);
    e->resumables = p;
    e->fd = -1;
    pthread_mutex_init(&e->syncing, NULL);
    pthread_mutex_init(&e->mutex, NULL);
    e->next = p->first;
    p->first = e;
    return e;
}

enum status upload_session_get(struct resumables *p, const char *id, struct upload_session **out, struct error *err) {
    pthread_mutex_lock(&p->mutex);
    struct upload_session *e = find(p, id);
    if (!e)
        e = add(p, id);
    e->users++;
    pthread_mutex_unlock(&p->mutex);
    enum status status = STATUS_OK;
    pthread_mutex_lock(&e->mutex);
    if (e->is_gone)
        status = error_set(err, STATUS_NOT_FOUND, "there is no upload %s", id);
    else if (!e->is_loaded)
        status = load(e, err);
    pthread_mutex_unlock(&e->mutex);
    if (status != STATUS_OK)
        upload_session_put(e);
    *out = status == STATUS_OK ? e : NULL;
    return status;
}

struct upload_session *upload_session_next(struct resumables *p, unsigned long round) {
    pthread_mutex_lock(&p->mutex);
    struct upload_session *e = p->first;
    while (e && (e->users > 0 || e->visited == round))
        e = e->next;
    if (e) {
        e->users++;
        e->visited = round;
    }
    pthread_mutex_unlock(&p->mutex);
    return e;
}

void upload_session_mark_gone(struct resumables *p, const char *id) {
    pthread_mutex_lock(&p->mutex);
    struct upload_session *e = find(p, id);
    if (e)
        e->users++;
    pthread_mutex_unlock(&p->mutex);
    if (!e)
        return;
    pthread_mutex_lock(&e->mutex);
    e->is_gone = true;
    pthread_mutex_unlock(&e->mutex);
    upload_session_put(e);
}

bool upload_session_is_whole(struct upload_session *e) {
    pthread_mutex_lock(&e->mutex);
    bool is_whole = !e->is_gone && e->counted == e->length;
    pthread_mutex_unlock(&e->mutex);
    return is_whole;
}

enum status upload_session_shrink(struct upload_session *e, struct error *err) {
    enum status status = STATUS_OK;
    pthread_mutex_lock(&e->mutex);
    /* To the size that it has: what fallocate has set aside beyond it goes. */
    if (!e->is_gone && !e->holder && e->fd >= 0 && ftruncate(e->fd, (off_t)e->received) != 0)
        status = error_set_errno(err, errno, "cannot give back the space of upload %s", e->id);
    pthread_mutex_unlock(&e->mutex);
    return status;
}

void upload_session_close(struct upload_session *e) {
    pthread_mutex_lock(&e->mutex);
    e->is_loaded = false; /* the next to come reads its row */
    e->holder = NULL;
    pthread_mutex_unlock(&e->mutex);
}

/* --- counting ------------------------------------------------------------------------------ */

/* What was received since the last commit may be lost: where a sync has failed, the kernel can have
 * dropped it, and the next sync would say that all is well. It is to be sent again. e->syncing is held. */
static void forget_tail(struct upload_session *e) {
    struct error err;
    pthread_mutex_lock(&e->mutex);
    e->received = e->counted;
    e->is_loaded = false; /* the next to come reads row and hash again */
    e->holder = NULL;
    e->needs_truncation = ftruncate(e->fd, (off_t)e->counted) != 0 &&
                    store_upload_begin(e->resumables->config.store, e->id, "", &err) != STATUS_OK;
    if (e->needs_truncation)
        log_warning("upload %s: %s", e->id, err.message);
    pthread_mutex_unlock(&e->mutex);
}

/* e->syncing is held, so nothing else counts or forgets. */
static enum status commit_alone(struct upload_session *e, struct error *err) {
    pthread_mutex_lock(&e->mutex);
    uint64_t received = e->received;
    struct sha256 hash = e->hash;
    bool needs_truncation = e->needs_truncation && !e->is_gone, has_news = !e->is_gone && received > e->counted;
    pthread_mutex_unlock(&e->mutex);
    if (needs_truncation)
        forget_tail(e);
    if (needs_truncation || !has_news)
        return STATUS_OK;
    if (fdatasync(e->fd) != 0) {
        enum status failed = error_set_errno(err, errno, "cannot sync upload %s", e->id);
        forget_tail(e);
        return failed;
    }
    pthread_mutex_lock(&e->mutex);
    enum status status = store_upload_advance(e->resumables->config.store, e->id, received, &hash, sizeof hash, err);
    if (status == STATUS_OK)
        e->counted = received;
    pthread_mutex_unlock(&e->mutex);
    return status;
}

enum status upload_session_commit(struct upload_session *e, struct error *err) {
    pthread_mutex_lock(&e->syncing);
    enum status status = commit_alone(e, err);
    pthread_mutex_unlock(&e->syncing);
    return status;
}

enum status upload_session_distrust_tail(struct upload_session *e, struct error *err) {
    enum status status = upload_session_commit(e, err);
    if (status == STATUS_OK)
        status = store_upload_begin(e->resumables->config.store, e->id, "", err);
    pthread_mutex_lock(&e->mutex);
    if (status == STATUS_OK)
        e->tail_is_trusted = false;
    pthread_mutex_unlock(&e->mutex);
    return status;
}
