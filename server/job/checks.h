/* checks.h -- chooses the scene that is checked next.
 *
 * 1. Where there are several slots, one user's scenes take all but one: another user need not wait until large archives
 *    have been read.
 * 2. The next user is the one whose last check began the longest ago.
 * 3. Of that user's scenes, the oldest comes next. */
#ifndef UNBAKE_JOB_CHECKS_H
#define UNBAKE_JOB_CHECKS_H

#include "server/job/attempt.h"

#define CHECKS_AT_ONCE 2 /* unless the configuration says otherwise */
#define CHECKS_USERS 256 /* users whose last turn is remembered, and who are considered */

struct checks {
    uint64_t clock; /* number of checks begun */
    size_t count;
    struct {
        int64_t owner_id;
        uint64_t begun;   /* the clock at that time */
    } last[CHECKS_USERS]; /* [count] */
};

/* The scene to check next; counts its check as begun. slots[count] tell what is being checked. STATUS_NOT_FOUND: none
 * may start. */
enum status checks_next(struct checks *c, struct store *store, const struct attempt *slots, size_t count,
                        struct unchecked *next, struct error *err);

#endif
