/* outcome.h -- how an attempt ended, judged from what its process left and said, and what that makes of the
 * job or the scene. */
#ifndef UNBAKE_JOB_OUTCOME_H
#define UNBAKE_JOB_OUTCOME_H

#include "server/job/attempt.h"

struct trash; /* data/trash.h */

/* Whether an ended attempt was too large for the disk. */
bool outcome_lacks_room(const struct attempt *a);

/* Enters the outcome of an ended attempt and empties it. Where that fails (the disk of state.db is full) the
 * attempt stays ended and is settled again later: nothing of the outcome is lost. What a failed check has unpacked goes to
 * `trash`, or is removed at once where that is NULL. */
enum status outcome_settle(struct attempt *a, struct store *store, struct trash *trash, struct counters *counters,
                           struct error *err);

#endif
