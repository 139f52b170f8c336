/* upload_session.h -- one upload in parts while it is in use: its file, what of it has come in, what of that is
 * on disk and counted. Made when a request or the collector asks for it, gone when nobody uses it and all
 * of it is counted. For resumable.c and upload_writer.c; the invariants are resumable.h's.
 *
 * Lock order: resumables.finishing, resumables.mutex, upload_session.syncing, upload_session.mutex. A session's mutex
 * may be held for long while it is loaded, so it is taken under resumables.mutex only when nobody uses it. */
#ifndef UNBAKE_UPLOADS_UPLOAD_SESSION_H
#define UNBAKE_UPLOADS_UPLOAD_SESSION_H

#include <pthread.h>

#include "common/sha256.h"
#include "server/data/folder.h"
#include "server/store/store.h"
#include "server/uploads/resumables_config.h"

struct upload_writer; /* upload_writer.h */

struct upload_session {
    char id[UPLOAD_ID_SIZE];
    struct resumables *resumables;
    unsigned users;        /* guarded by resumables->mutex, like the next: */
    unsigned long visited; /* the last round of upload_session_next that returned it */
    struct upload_session *next;
    pthread_mutex_t syncing; /* held during a commit */
    pthread_mutex_t mutex;   /* guards what follows */
    bool is_loaded, is_gone;
    bool needs_truncation; /* the file must be truncated to `counted`; that has failed before */
    int fd;                /* -1 before it is loaded; then constant until the session is dropped */
    uint64_t length;
    uint64_t received, counted;         /* in the file; in the store */
    uint64_t hinted;                    /* write-back has been started up to here */
    struct sha256 hash;                 /* of what was received */
    bool tail_is_trusted;               /* see resumable.h, invariant 3 */
    const struct upload_writer *writer; /* NULL: nobody writes */
};

struct resumables {
    struct resumables_config config;
    char boot[UPLOAD_BOOT_SIZE]; /* the current boot id; "": unknown */
    pthread_mutex_t mutex;       /* guards the list, users and rounds */
    struct upload_session *first;
    unsigned long round;
    pthread_mutex_t finishing; /* one upload becomes a scene at a time */
};

char *upload_session_path(const struct resumables *r, const char *id); /* path of the upload's file; the caller's */

/* The upload's session, loaded, with one more user. STATUS_CONFLICT: the upload is finished. */
enum status upload_session_get(struct resumables *r, const char *id, struct upload_session **out, struct error *err);
/* A session without users that this round has not returned yet, with one more user; NULL: none is left. */
struct upload_session *upload_session_next(struct resumables *r, unsigned long round);
void upload_session_put(struct upload_session *s);  /* one user less */
void upload_session_drop(struct upload_session *s); /* it has no users */
/* The upload is removed: its remaining users find it gone. */
void upload_session_mark_gone(struct resumables *r, const char *id);

/* Syncs and counts what was received. After a disk error, uncounted bytes are dropped. */
enum status upload_session_commit(struct upload_session *s, struct error *err);
bool upload_session_is_whole(struct upload_session *s); /* complete, and counted */
/* Frees the blocks beyond what has arrived, unless somebody writes. */
enum status upload_session_shrink(struct upload_session *s, struct error *err);
/* It has become a scene; later users find it finished. */
void upload_session_close(struct upload_session *s);
/* From now on bytes beyond the counted ones do not count after a restart: they are unchecked. */
enum status upload_session_distrust_tail(struct upload_session *s, struct error *err);

#endif
