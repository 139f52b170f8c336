/* outcome.h -- judges from its exit status and its messages how an attempt ended, and enters the outcome for the job
 * or scene. */
#ifndef UNBAKE_JOB_OUTCOME_H
#define UNBAKE_JOB_OUTCOME_H

#include "server/job/attempt.h"

struct trash; /* data/trash.h */

/* Whether an ended attempt ran out of disk space. */
bool outcome_lacks_space(const struct attempt *a);

/* Enters the outcome of an ended attempt and empties it. Where that fails (the disk of state.db is full) the attempt
 * stays ended and is settled later: nothing is lost. What a failed check has unpacked goes to `trash`; where that is
 * NULL it is removed at once. */
enum status outcome_settle(struct attempt *a, struct store *store, struct trash *trash, struct counters *counters,
                           struct error *err);

#endif
