/* transition.h -- what all changes of a job's state have in common; for the store's own files. The diagram is in job.h,
 * who makes which change in transitions.c and attempts.c. */
#ifndef UNBAKE_STORE_TRANSITION_H
#define UNBAKE_STORE_TRANSITION_H

#include "server/job/job.h"
#include "server/store/internal.h"

struct present {
    int64_t id;
    enum job_state state;
    enum job_wanted wanted;
    int attempt, attempts_left;
    const char *ending; /* of its attempt, before it leaves `running` (attempts.h); else NULL */
};

/* Inside a transaction: reads the job. */
enum status transition_look(struct store *store, int64_t id, struct present *now, struct error *err);
/* Locks, begins and reads the job. On an error everything is undone already. */
enum status transition_begin(struct store *store, int64_t id, struct present *now, struct error *err);
/* The same for what stops work, and works on a full disk. */
enum status transition_begin_stopping(struct store *store, int64_t id, struct present *now, struct error *err);
/* That the job's state does not allow it. */
enum status transition_forbidden(const struct present *now, const char *action, struct error *err);
/* The only place that writes a state, and with it the phase of the job's attempt. *now becomes the new present. */
enum status transition_move(struct store *store, struct present *now, enum job_state to, const char *reason,
                            const char *hint, struct error *err);
/* Appends the state's event. */
enum status transition_tell(struct store *store, const struct present *now, const char *reason, const char *hint,
                            struct error *err);

#endif
