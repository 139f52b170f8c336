/* intake.h -- one upload in parts while it is in use: its file, what of it has come in, what of that is
 * on disk and counted. Made when a request or the collector asks for it, gone when nobody uses it and all
 * of it is counted. For partial.c and claim.c; the invariants are partial.h's.
 *
 * Lock order: partials.finishing, partials.mutex, intake.syncing, intake.mutex. An intake's mutex may be
 * held for long while it is loaded, so it is taken under partials.mutex only when nobody uses it. */
#ifndef UNBAKE_HTTP_INTAKE_H
#define UNBAKE_HTTP_INTAKE_H

#include <pthread.h>

#include "common/sha256.h"
#include "server/http/api.h"

struct claim; /* claim.h */

struct intake {
    char id[UPLOAD_ID_SIZE];
    struct partials *partials;
    unsigned users;       /* under partials->mutex, and so are: */
    unsigned long tended; /* the round of intake_next that last gave it */
    struct intake *next;
    pthread_mutex_t syncing; /* held by a commit */
    pthread_mutex_t mutex;   /* guards what follows */
    bool is_loaded, is_gone;
    bool is_spoiled; /* what the file has beyond `counted` must be cut off and could not be yet */
    int fd;          /* -1 before it is loaded; then the same until the intake is dropped */
    uint64_t length;
    uint64_t received, counted; /* in the file; in the store */
    uint64_t hinted;            /* writing out has begun up to here */
    struct sha256 hash;         /* of what was received */
    bool is_believed;           /* see partial.h, invariant 3 */
    const struct claim *holder; /* NULL: nobody writes */
};

struct partials {
    struct api *api;
    char boot[UPLOAD_BOOT_SIZE]; /* of the machine; "": not known */
    pthread_mutex_t mutex;       /* guards the list, users and rounds */
    struct intake *first;
    unsigned long round;
    pthread_mutex_t finishing; /* one upload becomes a scene at a time */
};

char *intake_path(const struct partials *p, const char *id); /* of the upload's file; the caller's */

/* The upload's intake, loaded, for one more user. STATUS_CONFLICT: it is finished. */
enum status intake_get(struct partials *p, const char *id, struct intake **out, struct error *err);
/* One that nobody uses and that was not given in this round yet, for one more user; NULL: there is none. */
struct intake *intake_next(struct partials *p, unsigned long round);
void intake_put(struct intake *e); /* one user less */
void intake_drop(struct intake *e); /* nobody uses it */
/* The upload is removed: whoever still uses it finds it gone. */
void intake_mark_gone(struct partials *p, const char *id);

/* What was received is on disk and counted. Where the disk fails, what is not counted is forgotten. */
enum status intake_commit(struct intake *e, struct error *err);
bool intake_is_whole(struct intake *e); /* and counted */
/* It has become a scene: the next to come finds it so. */
void intake_close(struct intake *e);
/* From now on the file's tail is not to be believed, since unchecked bytes come. */
enum status intake_disbelieve(struct intake *e, struct error *err);

#endif
