/* link_files.c -- the files of link.h. */
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/clock.h"
#include "common/mem.h"
#include "common/url.h"
#include "server/net/field.h"
#include "server/node/link.h"

/* Hashing a scene of some ten GB for its list, or syncing a large part, is silent for long. */
#define LIST_SILENCE_SEC 300.0
#define SEND_SILENCE_SEC 60.0
#define FETCH_SILENCE_SEC 20.0
#define TRIES_MAX 40 /* of one file while reports are answered: some three minutes */
/* A daemon looks at its disk every 2 s and then asks attempts to stop; a node hears of it with its next report. */
#define FULL_SEC 15.0

#define HTTP_NO_SPACE 507 /* Insufficient Storage (RFC 4918) */

struct transfer {
    struct attempt_link *link;
    int fd;
    uint64_t at; /* in the file */
    uint64_t bytes;
    struct error *err;
    enum status status; /* of the file here */
    bool is_fetch;
};

static void tick(void *user, double sent) {
    struct transfer *t = user;
    (void)sent;
    t->link->beat(t->link->user);
}

/* Once the lease is over nothing is written any more; nothing is fetched for an attempt that is to stop. */
static enum status may_go_on(const struct transfer *t, struct error *err) {
    struct attempt_link *l = t->link;
    if (link_state(l) != LINK_OPEN)
        return error_set(err, STATUS_CANCELLED, "%s", l->why);
    return !t->is_fetch || !l->may_begin || l->may_begin(l->user, err) ? STATUS_OK : STATUS_CANCELLED;
}

static bool go_on(void *transfer) { return may_go_on(transfer, NULL) == STATUS_OK; }

static char *path_of(const struct attempt_link *l, const char *what, const char *name, const char *query) {
    struct buf path;
    buf_init(&path, 1 << 20);
    buf_printf(&path, "%s/%s", l->path, what);
    if (name) {
        buf_puts(&path, "/");
        url_encode(&path, name, false); /* a slash within is one part of the path: names may be deep */
    }
    buf_puts(&path, query);
    return buf_detach(&path);
}

/* Whether a file that has met the daemon's full disk is sent again. */
static bool waits_for_room(struct attempt_link *l) {
    if (l->full_until == 0.0)
        l->full_until = clock_sec() + FULL_SEC;
    return l->wanted < LINK_STOP && clock_sec() < l->full_until;
}

/* Runs the call until it succeeds, is refused, or may not go on. `begin` (may be NULL) prepares each try; `member`
 * (likewise) is one that the answer has. */
static enum status run(struct attempt_link *l, struct request_call *call, struct transfer *t, const char *member,
                       enum status (*begin)(struct request_call *call, struct transfer *t, struct error *err),
                       struct reply *reply, struct error *err) {
    enum status status;
    call->header[0] = l->claimant;
    call->tick = tick;
    call->go_on = go_on;
    call->user = t;
    call->once = true;
    for (int tries = 0;; tries++) {
        status = may_go_on(t, err);
        if (status == STATUS_OK && begin)
            status = begin(call, t, err);
        if (status != STATUS_OK)
            return status;
        status = request_run(l->bulk, call, reply, err);
        if (member)
            status = link_whole(l, status, reply, member, err);
        link_read_reply(l, status, reply, err);
        if (t->status != STATUS_OK)
            return t->status;
        if (status == STATUS_CANCELLED) {
            may_go_on(t, err); /* says why */
            return status;
        }
        bool is_again =
            link_is_busy(status, reply) ? tries < TRIES_MAX : reply->code == HTTP_NO_SPACE && waits_for_room(l);
        if (!is_again || !link_pause(l, tries))
            return status;
    }
}

enum status link_list(struct attempt_link *l, const char *what, cJSON **list, struct error *err) {
    struct reply reply;
    struct transfer t = {.link = l, .is_fetch = true};
    char *path = path_of(l, what, NULL, "");
    struct request_call call = {.path = path, .silence_sec = LIST_SILENCE_SEC};
    reply_init(&reply);
    enum status status = run(l, &call, &t, "files", NULL, &reply, err);
    if (status == STATUS_OK && !cJSON_IsArray(cJSON_GetObjectItemCaseSensitive(reply.json, "files")))
        status = error_set(err, STATUS_UNAVAILABLE, "the daemon's list of files cannot be read");
    *list = status == STATUS_OK ? reply.json : NULL;
    if (status == STATUS_OK)
        reply.json = NULL;
    reply_release(&reply);
    mem_free(path);
    return status;
}

/* --- to here --------------------------------------------------------------------------------- */

static bool take_bytes(void *user, const struct reply *reply, const char *bytes, size_t length) {
    struct transfer *t = user;
    /* The whole file comes where the rest was asked for: from its beginning, then. */
    if (reply->code == 200 && t->at > 0 && t->bytes == 0)
        t->at = 0;
    size_t done = 0;
    while (done < length && t->status == STATUS_OK) {
        ssize_t wrote = pwrite(t->fd, bytes + done, length - done, (off_t)t->at);
        if (wrote < 0 && errno == EINTR)
            continue;
        if (wrote < 0)
            t->status = error_set_errno(t->err, errno, "cannot write what is fetched");
        done += wrote > 0 ? (size_t)wrote : 0;
        t->at += wrote > 0 ? (uint64_t)wrote : 0;
        t->bytes += wrote > 0 ? (uint64_t)wrote : 0;
    }
    return t->status == STATUS_OK;
}

/* Asks for what is not here yet. */
static enum status begin_fetch(struct request_call *call, struct transfer *t, struct error *err) {
    struct stat info;
    static const char *const whole = NULL;
    if (fstat(t->fd, &info) != 0)
        return error_set_errno(err, errno, "cannot access what is fetched");
    t->at = (uint64_t)info.st_size;
    t->link->fetched_bytes += t->bytes;
    t->bytes = 0;
    mem_free((void *)call->header[1]);
    call->header[1] = t->at > 0 ? mem_printf("Range: bytes=%llu-", (unsigned long long)t->at) : whole;
    return STATUS_OK;
}

enum status link_fetch(struct attempt_link *l, const char *what, const char *name, int fd, struct error *err) {
    struct reply reply;
    struct transfer t = {.link = l, .fd = fd, .err = err, .is_fetch = true};
    char *path = path_of(l, what, name, "");
    struct request_call call = {.path = path, .sink = take_bytes, .silence_sec = FETCH_SILENCE_SEC};
    reply_init(&reply);
    enum status status = run(l, &call, &t, NULL, begin_fetch, &reply, err);
    if (status != STATUS_OK && reply.code == 416) /* there is nothing more */
        status = STATUS_OK;
    l->fetched_bytes += t.bytes;
    mem_free((void *)call.header[1]);
    reply_release(&reply);
    mem_free(path);
    return status;
}

/* --- from here -------------------------------------------------------------------------------- */

static enum status give_bytes(void *user, void *bytes, size_t room, size_t *got, struct error *err) {
    struct transfer *t = user;
    ssize_t n;
    if (link_state(t->link) != LINK_OPEN)
        return error_set(err, STATUS_CANCELLED, "%s", t->link->why);
    do
        n = pread(t->fd, bytes, room, (off_t)t->at);
    while (n < 0 && errno == EINTR);
    if (n < 0)
        return t->status = error_set_errno(err, errno, "cannot read what is sent");
    *got = (size_t)n;
    t->at += (uint64_t)n;
    return STATUS_OK;
}

static enum status rewind_bytes(void *user, struct error *err) {
    struct transfer *t = user;
    (void)err;
    t->at = 0;
    return STATUS_OK;
}

enum status link_send(struct attempt_link *l, const char *what, const char *name, const char *query, int fd,
                      const char *hex, struct error *err) {
    struct reply reply;
    struct stat info;
    struct transfer t = {.link = l, .fd = fd, .err = err};
    char value[64], digest[96];
    if (fstat(fd, &info) != 0)
        return error_set_errno(err, errno, "cannot access %s", name ? name : what);
    field_digest_format(hex, value);
    snprintf(digest, sizeof digest, "Repr-Digest: %s", value);
    char *path = path_of(l, what, name, query);
    struct request_call call = {.method = "PUT",
                                .path = path,
                                .header = {NULL, digest},
                                .read = give_bytes,
                                .rewind = rewind_bytes,
                                .read_length = (uint64_t)info.st_size,
                                .silence_sec = SEND_SILENCE_SEC,
                                .same_twice = true};
    reply_init(&reply);
    enum status status = run(l, &call, &t, NULL, NULL, &reply, err);
    l->is_full_there = status == STATUS_NO_SPACE && reply.code == HTTP_NO_SPACE;
    if (status == STATUS_OK) {
        l->sent_bytes += (uint64_t)info.st_size;
        l->full_until = 0.0;
    } else if (l->is_full_there) {
        error_prefix(err, "at the daemon");
        if (l->wanted >= LINK_STOP)
            status = err->status = STATUS_CANCELLED;
    }
    reply_release(&reply);
    mem_free(path);
    return status;
}
