/* checks.h -- whose scene is checked next.
 *
 * 1. One user's scenes take at most all slots but one (where there are several): one is left for who comes next, who need
 *    not wait until the first of another's large archives is read.
 * 2. Of the users that wait, the one goes first whose last check began the longest ago.
 * 3. Of one user's scenes, the oldest. */
#ifndef UNBAKE_JOB_CHECKS_H
#define UNBAKE_JOB_CHECKS_H

#include "server/job/attempt.h"

#define CHECKS_AT_ONCE 2
#define CHECKS_USERS 256 /* whose turns are remembered, and who are looked at */

struct checks {
    uint64_t clock; /* checks that were begun */
    size_t count;
    struct {
        int64_t owner_id;
        uint64_t begun;   /* the clock then */
    } last[CHECKS_USERS]; /* [count] */
};

/* The scene that the next check is of, which begins now; slots[count] tell what is being checked. STATUS_NOT_FOUND: none
 * may. */
enum status checks_next(struct checks *c, struct store *store, const struct attempt *slots, size_t count,
                        struct unchecked *next, struct error *err);

#endif
