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
    int attempt; /* the newest; while one ends, that one */
    int attempts_left;
    int part;           /* while an attempt ends: of which it is; else 0 */
    const char *ending; /* of its attempts, before it leaves `running` (attempts.h); else NULL */
};

/* Inside a transaction: reads the job. */
enum status transition_read(struct store *store, int64_t id, struct present *now, struct error *err);
/* Locks, begins and reads the job. On an error everything is undone already. */
enum status transition_begin(struct store *store, int64_t id, struct present *now, struct error *err);
/* The same for what stops work, and works on a full disk. */
enum status transition_begin_stopping(struct store *store, int64_t id, struct present *now, struct error *err);
/* That the job's state does not allow it. */
enum status transition_forbidden(const struct present *now, const char *action, struct error *err);
/* The only place that writes a state, and with it the phases of the job's attempts. *now becomes the new present. */
enum status transition_move(struct store *store, struct present *now, enum job_state to, const char *reason,
                            const char *hint, struct error *err);
/* Appends the state's event. */
enum status transition_append_event(struct store *store, const struct present *now, const char *reason,
                                    const char *hint, struct error *err);

/* attempts.c: */

/* As transition_begin_stopping, for the end of an attempt that the job must be running; it ends so. */
enum status attempt_begin_end(struct store *store, int64_t id, int attempt, const char *ending, struct present *now,
                              struct error *err);
/* That attempt ends, by which the job would become `to`; where others run, or the job's parts go on, it stays as it
 * is. */
enum status attempt_leave(struct store *store, struct present *now, enum job_state to, const char *reason,
                          const char *hint, struct error *err);

/* Inside a transaction: one attempt of several ends, and its job goes on. */
enum status attempt_end_one(struct store *store, const struct present *now, struct error *err);

/* parts.c, inside a transaction: */

/* The attempt's part becomes what it is by that end: `to` is what it would make of a job without parts. */
enum status part_end(struct store *store, const struct present *now, enum job_state to, const char *reason,
                     const char *hint, struct error *err);
/* Where the job's parts take it: JOB_FAILED, JOB_PAUSED with why, or JOB_QUEUED. */
struct part_verdict {
    enum job_state to;
    char reason[1024], hint[256];
};
enum status part_verdict(struct store *store, int64_t id, struct part_verdict *verdict, struct error *err);
/* Appends an event of the log that says how the attempt of a part has ended, or, for part 0, that there are parts. */
enum status part_append_event(struct store *store, const struct present *now, enum job_state to, const char *reason,
                              struct error *err);

#endif
