/* partial.c -- see partial.h.
 *
 * An entry stands for one upload while a request uses it or it holds bytes that are not counted
 * yet. Lock order: partials.finishing, partials.mutex, entry.syncing, entry.mutex. An entry's mutex may
 * be held for long while it is loaded, so it is taken under partials.mutex only when nobody uses it.
 *
 * One commit of an upload at a time: of two syncs at once the kernel tells one of a page that it could
 * not write, and the other that all is well. */
#include "server/http/partial.h"

#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdio.h>
#include <string.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/buf.h"
#include "common/file.h"
#include "common/log.h"
#include "common/mem.h"
#include "common/sha256.h"
#include "server/http/space.h"
#include "server/http/upload.h"

#define COMMIT_BYTES ((uint64_t)64 << 20) /* counted at least so often; a kill costs hashing them again */
#define HINT_BYTES ((uint64_t)8 << 20)    /* writing out begins so often, so that a commit is short */
#define UNFINISHED_MAX 10000

struct entry {
    char id[UPLOAD_ID_SIZE];
    struct partials *partials;
    unsigned users; /* under partials->mutex, and so are: */
    unsigned long tended; /* the round of partials_tend that last saw to it */
    struct entry *next;
    pthread_mutex_t syncing; /* held by a commit */
    pthread_mutex_t mutex; /* guards what follows */
    bool is_loaded, is_gone;
    bool is_spoiled; /* what the file has beyond `counted` must be cut off and could not be yet */
    int fd; /* -1 before it is loaded; then the same until the entry is dropped */
    uint64_t length;
    uint64_t received, counted; /* in the file; in the store */
    uint64_t hinted;
    struct sha256 hash;         /* of what was received */
    bool is_believed;           /* see invariant 3 */
    const struct claim *holder; /* NULL: nobody writes */
};

struct partials {
    struct api *api;
    char boot[UPLOAD_BOOT_SIZE];
    pthread_mutex_t mutex; /* guards the list and `users` */
    struct entry *first;
    unsigned long round;
    pthread_mutex_t finishing; /* one upload becomes a scene at a time */
};

struct claim {
    struct entry *entry;
    bool is_checked;
    uint64_t at;        /* where it writes next */
    struct sha256 hash; /* where is_checked: up to `at` */
};

static char *path_of(const struct partials *p, const char *id) {
    return mem_printf("%s/uploads/%s", p->api->config.data_dir, id);
}

/* --- entries ----------------------------------------------------------------------------- */

/* Hashes what lies in the file from e->received to its end: written, but never counted. */
static enum status believe_tail(struct entry *e, struct error *err) {
    struct stat info;
    if (fstat(e->fd, &info) != 0)
        return error_set_errno(err, errno, "cannot look at upload %s", e->id);
    uint64_t end = (uint64_t)info.st_size < e->length ? (uint64_t)info.st_size : e->length;
    char *chunk = mem_alloc((size_t)1 << 18);
    enum status status = STATUS_OK;
    while (status == STATUS_OK && e->received < end) {
        uint64_t left = end - e->received;
        ssize_t got = pread(e->fd, chunk, left < (1 << 18) ? (size_t)left : (size_t)1 << 18,
                            (off_t)e->received);
        if (got < 0 && errno == EINTR)
            continue;
        if (got <= 0) {
            status = error_set_errno(err, got < 0 ? errno : EIO, "cannot read upload %s", e->id);
            break;
        }
        sha256_update(&e->hash, chunk, (size_t)got);
        e->received += (uint64_t)got;
    }
    mem_free(chunk);
    return status;
}

/* The machine was started anew since: what lies beyond the counted bytes may be anything. */
static enum status cut_tail(struct entry *e, struct error *err) {
    if (ftruncate(e->fd, (off_t)e->received) != 0)
        return error_set_errno(err, errno, "cannot cut upload %s", e->id);
    if (fallocate(e->fd, FALLOC_FL_KEEP_SIZE, 0, (off_t)e->length) != 0 && errno != EOPNOTSUPP)
        return error_set_errno(err, errno, "cannot reserve %llu bytes for upload %s",
                               (unsigned long long)e->length, e->id);
    return store_upload_begin(e->partials->api->store, e->id, e->partials->boot, err);
}

static enum status load(struct entry *e, struct error *err) {
    struct partials *p = e->partials;
    struct upload_row row;
    enum status status = store_upload_get(p->api->store, e->id, &row, &e->hash, sizeof e->hash, err);
    if (status != STATUS_OK)
        return status;
    char *path = path_of(p, e->id);
    e->length = row.length;
    e->received = e->counted = e->hinted = row.received;
    e->is_believed = *row.boot != '\0';
    if (*row.scene_id)
        status = error_set(err, STATUS_CONFLICT, "upload %s is finished", e->id);
    else if (e->fd < 0 && (e->fd = open(path, O_RDWR | O_CLOEXEC | O_NOFOLLOW)) < 0 &&
             (errno != ENOENT || e->received < e->length)) /* whole, it may be on its way: see place */
        status = error_set_errno(err, errno, "cannot open %s", path);
    else if (e->fd >= 0 && e->is_believed && !e->is_spoiled && strcmp(row.boot, p->boot) == 0)
        status = believe_tail(e, err);
    else if (e->fd >= 0 && e->is_believed)
        status = cut_tail(e, err);
    e->is_spoiled = e->is_spoiled && status != STATUS_OK;
    mem_free(path);
    upload_row_release(&row);
    return status;
}

static void drop(struct entry *e) {
    struct entry **link = &e->partials->first;
    while (*link != e)
        link = &(*link)->next;
    *link = e->next;
    if (e->fd >= 0)
        close(e->fd);
    pthread_mutex_destroy(&e->mutex);
    pthread_mutex_destroy(&e->syncing);
    mem_free(e);
}

static bool is_clean(struct entry *e) {
    pthread_mutex_lock(&e->mutex);
    bool clean = e->is_gone || (!e->is_spoiled && (!e->is_loaded || e->received == e->counted));
    pthread_mutex_unlock(&e->mutex);
    return clean;
}

static void put(struct entry *e) {
    struct partials *p = e->partials;
    pthread_mutex_lock(&p->mutex);
    if (--e->users == 0 && is_clean(e))
        drop(e);
    pthread_mutex_unlock(&p->mutex);
}

static struct entry *find(struct partials *p, const char *id) {
    struct entry *e = p->first;
    while (e && strcmp(e->id, id) != 0)
        e = e->next;
    return e;
}

/* The upload's entry, loaded, for one more user; the caller calls put. */
static enum status get(struct partials *p, const char *id, struct entry **out, struct error *err) {
    pthread_mutex_lock(&p->mutex);
    struct entry *e = find(p, id);
    if (!e) {
        e = mem_calloc(1, sizeof *e);
        snprintf(e->id, sizeof e->id, "%s", id);
        e->partials = p;
        e->fd = -1;
        pthread_mutex_init(&e->syncing, NULL);
        pthread_mutex_init(&e->mutex, NULL);
        e->next = p->first;
        p->first = e;
    }
    e->users++;
    pthread_mutex_unlock(&p->mutex);
    enum status status = STATUS_OK;
    pthread_mutex_lock(&e->mutex);
    if (e->is_gone) {
        status = error_set(err, STATUS_NOT_FOUND, "there is no upload %s", id);
    } else if (!e->is_loaded) {
        status = load(e, err);
        e->is_loaded = status == STATUS_OK;
    }
    pthread_mutex_unlock(&e->mutex);
    if (status != STATUS_OK)
        put(e);
    *out = status == STATUS_OK ? e : NULL;
    return status;
}

/* What was received since the last commit may be lost: where a sync has failed, the kernel can have
 * dropped it, and the next sync would say that all is well. It is to be sent again. e->syncing is held. */
static void forget_tail(struct entry *e) {
    struct error err;
    pthread_mutex_lock(&e->mutex);
    e->received = e->counted;
    e->is_loaded = false; /* the next to come reads row and hash again */
    e->holder = NULL;
    e->is_spoiled = ftruncate(e->fd, (off_t)e->counted) != 0 &&
                    store_upload_begin(e->partials->api->store, e->id, "", &err) != STATUS_OK;
    if (e->is_spoiled)
        log_warning("upload %s: %s", e->id, err.message);
    pthread_mutex_unlock(&e->mutex);
}

static enum status lost(struct error *err) {
    error_set(err, STATUS_CONFLICT, "the disk failed: the upload stands at an earlier offset");
    return error_hint(err, "HEAD tells where; go on from there");
}

/* e->syncing is held, so nothing else counts or forgets. */
static enum status commit_alone(struct entry *e, struct error *err) {
    pthread_mutex_lock(&e->mutex);
    uint64_t received = e->received;
    struct sha256 hash = e->hash;
    bool has_news = !e->is_gone && received > e->counted;
    pthread_mutex_unlock(&e->mutex);
    if (!has_news)
        return STATUS_OK;
    if (fdatasync(e->fd) != 0) {
        enum status failed = error_set_errno(err, errno, "cannot sync upload %s", e->id);
        forget_tail(e);
        return failed;
    }
    pthread_mutex_lock(&e->mutex);
    enum status status = store_upload_advance(e->partials->api->store, e->id, received, &hash, sizeof hash, err);
    if (status == STATUS_OK)
        e->counted = received;
    pthread_mutex_unlock(&e->mutex);
    return status;
}

static enum status commit(struct entry *e, struct error *err) {
    pthread_mutex_lock(&e->syncing);
    enum status status = commit_alone(e, err);
    pthread_mutex_unlock(&e->syncing);
    return status;
}

/* --- from an upload to a scene ----------------------------------------------------------- */

/* The file is, or was about to be, at its place among the scenes. */
static enum status place(struct partials *p, const struct upload_row *row, const char *scene_id,
                         struct error *err) {
    struct api *api = p->api;
    char *path = path_of(p, row->id);
    bool existed;
    pthread_mutex_lock(&api->scene_mutex);
    enum status status = STATUS_OK;
    if (access(path, F_OK) == 0 || errno != ENOENT)
        status = upload_place(api, path, scene_id, err);
    if (status == STATUS_OK)
        status = store_scene_add(api->store, scene_id, row->name, row->length, row->owner_id,
                                 &existed, err);
    pthread_mutex_unlock(&api->scene_mutex);
    mem_free(path);
    return status == STATUS_OK ? store_upload_finish(api->store, row->id, scene_id, err) : status;
}

/* The upload `id` is whole and counted: makes its scene, once. */
static enum status finish(struct partials *p, const char *id, struct error *err) {
    struct upload_row row;
    struct sha256 hash;
    char scene_id[SHA256_HEX_SIZE];
    pthread_mutex_lock(&p->finishing);
    enum status status = store_upload_get(p->api->store, id, &row, &hash, sizeof hash, err);
    if (status == STATUS_OK && !*row.scene_id) {
        sha256_hex(&hash, scene_id);
        if (*row.sha256 && strcmp(row.sha256, scene_id) != 0) {
            partial_remove(p, id, NULL);
            error_set(err, STATUS_INPUT, "the upload's SHA-256 is %s, and its metadata says %s", scene_id,
                      row.sha256);
            status = error_hint(err, "it was removed: send the content again");
        } else {
            status = place(p, &row, scene_id, err);
        }
        if (status == STATUS_OK)
            scheduler_wake(p->api->scheduler);
    }
    pthread_mutex_unlock(&p->finishing);
    upload_row_release(&row);
    return status;
}

/* Commits; finishes what is whole. */
static enum status settle(struct entry *e, struct error *err) {
    pthread_mutex_lock(&e->syncing);
    pthread_mutex_lock(&e->mutex);
    bool is_spoiled = e->is_spoiled && !e->is_gone;
    pthread_mutex_unlock(&e->mutex);
    if (is_spoiled)
        forget_tail(e);
    enum status status = commit_alone(e, err);
    pthread_mutex_unlock(&e->syncing);
    pthread_mutex_lock(&e->mutex);
    bool is_whole = !e->is_gone && e->counted == e->length;
    pthread_mutex_unlock(&e->mutex);
    if (status == STATUS_OK && is_whole) {
        status = finish(e->partials, e->id, err);
        pthread_mutex_lock(&e->mutex);
        if (status == STATUS_OK) { /* the next to come finds it finished */
            e->is_loaded = false;
            e->holder = NULL;
        }
        pthread_mutex_unlock(&e->mutex);
    }
    return status;
}

/* --- all of them ------------------------------------------------------------------------- */

struct partials *partials_new(struct api *api) {
    struct partials *p = mem_calloc(1, sizeof *p);
    struct buf boot;
    p->api = api;
    pthread_mutex_init(&p->mutex, NULL);
    pthread_mutex_init(&p->finishing, NULL);
    buf_init(&boot, 256);
    /* Where it cannot be read, no tail is ever believed. */
    if (file_read("/proc/sys/kernel/random/boot_id", &boot, NULL) == STATUS_OK)
        snprintf(p->boot, sizeof p->boot, "%.*s", (int)strcspn(buf_text(&boot), "\n"), buf_text(&boot));
    buf_release(&boot);
    return p;
}

void partials_tend(struct partials *p) {
    pthread_mutex_lock(&p->mutex);
    unsigned long round = ++p->round;
    for (;;) {
        struct entry *e = p->first; /* without users it is there because it is dirty */
        while (e && (e->users > 0 || e->tended == round))
            e = e->next;
        if (!e)
            break;
        e->users++;
        e->tended = round;
        pthread_mutex_unlock(&p->mutex);
        struct error err;
        if (settle(e, &err) != STATUS_OK)
            log_warning("upload %s: %s", e->id, err.message);
        put(e);
        pthread_mutex_lock(&p->mutex);
    }
    pthread_mutex_unlock(&p->mutex);
}

void partials_free(struct partials *p) {
    if (!p)
        return;
    partials_tend(p);
    while (p->first)
        drop(p->first);
    pthread_mutex_destroy(&p->finishing);
    pthread_mutex_destroy(&p->mutex);
    mem_free(p);
}

enum status partials_recover(struct partials *p, struct error *err) {
    char cursor[128] = "";
    enum status status;
    do {
        struct upload_row rows[64];
        size_t count;
        char next[128];
        status = store_upload_list(p->api->store, NULL, "", cursor, 64, rows, &count, next, err);
        for (size_t i = 0; i < count; i++) {
            struct error why;
            if (!*rows[i].scene_id && rows[i].received == rows[i].length &&
                finish(p, rows[i].id, &why) != STATUS_OK)
                log_warning("upload %s: %s", rows[i].id, why.message);
            upload_row_release(&rows[i]);
        }
        memcpy(cursor, next, sizeof cursor);
    } while (status == STATUS_OK && *cursor);
    return status;
}

/* --- one of them ------------------------------------------------------------------------- */

static enum status new_id(char id[UPLOAD_ID_SIZE], struct error *err) {
    unsigned char random[(UPLOAD_ID_SIZE - 1) / 2];
    if (getrandom(random, sizeof random, 0) != (ssize_t)sizeof random)
        return error_set_errno(err, errno, "cannot get random numbers");
    for (size_t i = 0; i < sizeof random; i++)
        snprintf(id + 2 * i, 3, "%02x", random[i]);
    return STATUS_OK;
}

enum status partial_create(struct partials *p, struct upload_row *row, struct error *err) {
    struct sha256 hash;
    memset(&hash, 0, sizeof hash); /* all of it is stored */
    sha256_init(&hash);
    enum status status = new_id(row->id, err);
    if (status != STATUS_OK)
        return status;
    snprintf(row->boot, sizeof row->boot, "%s", p->boot);
    char *path = path_of(p, row->id);
    int fd = open(path, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
    if (fd < 0)
        status = error_set_errno(err, errno, "cannot create %s", path);
    else if (fallocate(fd, FALLOC_FL_KEEP_SIZE, 0, (off_t)row->length) != 0 && errno != EOPNOTSUPP)
        status = error_set_errno(err, errno, "cannot reserve %llu bytes for the upload",
                                 (unsigned long long)row->length);
    if (status == STATUS_OK && fsync(fd) != 0)
        status = error_set_errno(err, errno, "cannot sync %s", path);
    if (status == STATUS_OK)
        status = file_sync_parent(path, err);
    if (status == STATUS_OK)
        status = store_upload_add(p->api->store, row, &hash, sizeof hash, UNFINISHED_MAX, err);
    if (fd >= 0)
        close(fd);
    if (fd >= 0 && status != STATUS_OK)
        unlink(path);
    mem_free(path);
    return status;
}

enum status partial_look(struct partials *p, const char *id, struct upload_row *row, struct error *err) {
    struct entry *e;
    enum status status = store_upload_get(p->api->store, id, row, NULL, 0, err);
    if (status != STATUS_OK || *row->scene_id)
        return status;
    upload_row_release(row);
    status = get(p, id, &e, err);
    if (status == STATUS_OK) {
        status = settle(e, err);
        put(e);
    } else if (status == STATUS_CONFLICT) {
        status = STATUS_OK; /* finished just now */
    }
    return status == STATUS_OK ? store_upload_get(p->api->store, id, row, NULL, 0, err) : status;
}

/* From now on the file's tail is not to be believed, since unchecked bytes come. */
static enum status disbelieve(struct entry *e, struct error *err) {
    enum status status = commit(e, err);
    if (status == STATUS_OK)
        status = store_upload_begin(e->partials->api->store, e->id, "", err);
    pthread_mutex_lock(&e->mutex);
    if (status == STATUS_OK)
        e->is_believed = false;
    pthread_mutex_unlock(&e->mutex);
    return status;
}

enum status partial_claim(struct partials *p, const char *id, uint64_t offset, bool is_checked,
                          struct claim **out, struct error *err) {
    struct entry *e;
    *out = NULL;
    enum status status = get(p, id, &e, err);
    if (status != STATUS_OK)
        return status;
    pthread_mutex_lock(&e->mutex);
    bool must_disbelieve = is_checked && e->is_believed;
    pthread_mutex_unlock(&e->mutex);
    if (must_disbelieve)
        status = disbelieve(e, err);
    struct claim *claim = mem_calloc(1, sizeof *claim);
    pthread_mutex_lock(&e->mutex);
    if (status == STATUS_OK && !e->is_loaded) /* e->hash is still that of what was forgotten */
        status = lost(err);
    if (status == STATUS_OK && e->received != offset)
        status = error_set(err, STATUS_CONFLICT, "the upload stands at %llu, not at %llu",
                           (unsigned long long)e->received, (unsigned long long)offset);
    if (status == STATUS_OK) {
        *claim = (struct claim){e, is_checked, offset, e->hash};
        e->holder = claim;
    }
    pthread_mutex_unlock(&e->mutex);
    if (status == STATUS_OK) {
        *out = claim;
    } else {
        mem_free(claim);
        put(e);
    }
    return status;
}

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

static enum status check_holder(const struct claim *claim, struct error *err) {
    const struct entry *e = claim->entry;
    if (e->is_gone)
        return error_set(err, STATUS_NOT_FOUND, "the upload was removed");
    return e->holder == claim ? STATUS_OK
                              : error_set(err, STATUS_CONFLICT, "another request goes on with this upload");
}

enum status partial_write(struct claim *claim, const void *data, uint64_t length, struct error *err) {
    struct entry *e = claim->entry;
    pthread_mutex_lock(&e->mutex);
    enum status status = check_holder(claim, err);
    if (status == STATUS_OK && length > e->length - claim->at)
        status = error_set(err, STATUS_LIMIT, "the upload has %llu bytes, and more were sent",
                           (unsigned long long)e->length);
    if (status == STATUS_OK)
        status = write_at(e->fd, data, length, claim->at, err);
    if (status == STATUS_OK) {
        sha256_update(&claim->hash, data, length);
        claim->at += length;
        if (!claim->is_checked) {
            e->hash = claim->hash;
            e->received = claim->at;
        }
        if (claim->at - e->hinted >= HINT_BYTES || claim->at < e->hinted) {
            if (claim->at > e->hinted)
                (void)sync_file_range(e->fd, (off_t)e->hinted, (off_t)(claim->at - e->hinted),
                                      SYNC_FILE_RANGE_WRITE);
            e->hinted = claim->at;
        }
    }
    pthread_mutex_unlock(&e->mutex);
    return status;
}

uint64_t partial_room(const struct claim *claim) {
    return claim->entry->length - claim->at; /* the length never changes */
}

uint64_t partial_unreserved(struct claim *claim) {
    struct stat info;
    uint64_t length = claim->entry->length;
    if (fstat(claim->entry->fd, &info) != 0)
        return partial_room(claim);
    uint64_t has = (uint64_t)info.st_blocks * 512;
    return has < length ? length - has : 0;
}

bool partial_is_due(struct claim *claim) {
    struct entry *e = claim->entry;
    pthread_mutex_lock(&e->mutex);
    bool due = e->received - e->counted >= COMMIT_BYTES;
    pthread_mutex_unlock(&e->mutex);
    return due;
}

enum status partial_accept(struct claim *claim, struct error *err) {
    struct entry *e = claim->entry;
    pthread_mutex_lock(&e->mutex);
    enum status status = check_holder(claim, err);
    if (status == STATUS_OK) {
        e->hash = claim->hash;
        e->received = claim->at;
    }
    pthread_mutex_unlock(&e->mutex);
    return status;
}

enum status partial_commit(struct claim *claim, struct error *err) {
    return commit(claim->entry, err);
}

enum status partial_finish(struct claim *claim, struct upload_row *row, struct error *err) {
    struct entry *e = claim->entry;
    enum status status = partial_look(e->partials, e->id, row, err);
    if (status != STATUS_OK || row->received >= claim->at)
        return status;
    upload_row_release(row); /* another thread's sync has failed */
    return lost(err);
}

void partial_release(struct claim *claim) {
    if (!claim)
        return;
    struct entry *e = claim->entry;
    pthread_mutex_lock(&e->mutex);
    if (e->holder == claim)
        e->holder = NULL;
    pthread_mutex_unlock(&e->mutex);
    put(e);
    mem_free(claim);
}

enum status partial_forget(struct partials *p, const char *id, struct error *err) {
    enum status status = STATUS_OK;
    pthread_mutex_lock(&p->mutex);
    struct entry *e = find(p, id);
    if (e)
        e->users++;
    pthread_mutex_unlock(&p->mutex);
    if (e) {
        pthread_mutex_lock(&e->mutex);
        e->is_gone = true;
        pthread_mutex_unlock(&e->mutex);
        put(e);
    }
    char *path = path_of(p, id);
    if (unlink(path) != 0 && errno != ENOENT)
        status = error_set_errno(err, errno, "cannot remove %s", path);
    mem_free(path);
    return status;
}

enum status partial_remove(struct partials *p, const char *id, struct error *err) {
    enum status status = store_upload_delete(p->api->store, id, err);
    if (status == STATUS_NO_SPACE && space_spend_reserve(p->api))
        status = store_upload_delete(p->api->store, id, err);
    return status == STATUS_OK ? partial_forget(p, id, err) : status;
}
