/* attempts.h -- attempts of jobs: which there are, and how they begin and end. As for all of the store, see store.h.
 *
 *      (none) ──store_job_start──> RUNNING ──store_job_succeed, _fail, _crash, _lose, _stop, _block──> ENDED
 *                                     └──────store_reconcile────────────────────────────────────────────^
 *
 *      FORMER ──store_attempt_adopted──> RUNNING or ENDED, as its job is: attempts of an older version, whose files lie
 *                                        in their job's folder until the daemon has moved them (data/attempt_folder.h)
 *
 * 1. A row is RUNNING in a transaction in which its job is or becomes so, before anything of the attempt exists
 *    elsewhere; it is ENDED, at the latest, in the one in which its job leaves that state. Of a job, or of each part of
 *    one that is split (parts.h), at most one is RUNNING.
 * 2. Numbers only grow, over retries and parts too: a number names one attempt of the job for ever. All that is said in
 *    the name of one that is not RUNNING is refused (STATUS_CONFLICT).
 * 3. ENDED is a sink, and `ending` says how: one of the words of job.h. */
#ifndef UNBAKE_STORE_ATTEMPTS_H
#define UNBAKE_STORE_ATTEMPTS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "server/job/job.h"

struct store; /* store.h */

#define ATTEMPTS_LOST_MAX 5 /* in a row, before a job fails: what loses five may be the job's own doing */

struct attempt_key {
    int64_t job_id;
    int number;
};
struct attempt_row {
    int number;
    char executor[32]; /* where it ran: "process" */
    enum attempt_row_phase phase;
    char ending[16]; /* "" before the end */
};
/* Attempts of the job, newest first. Fills rows[limit]. */
enum status store_attempt_list(struct store *store, int64_t job_id, size_t limit, struct attempt_row *rows,
                               size_t *count, struct error *err);
enum status store_attempt_get(struct store *store, const struct attempt_key *key, struct attempt_row *row,
                              struct error *err);
/* One attempt that is FORMER; STATUS_NOT_FOUND when there is none. */
enum status store_attempt_former(struct store *store, int64_t *job_id, int *number, struct error *err);
/* Its files have been moved. */
enum status store_attempt_adopted(struct store *store, int64_t job_id, int number, struct error *err);

/* The scheduler's transitions, fenced by `attempt`: STATUS_CONFLICT when another attempt is current. A job whose scene
 * is being checked does not start. A running job that is split starts its next part, where there is one (parts.h). A
 * recorded request to cancel overrides every end; one to pause overrides a return to the queue. `executor` is the name
 * of what will run it. */
enum status store_job_start(struct store *store, int64_t id, const char *executor, int *attempt, struct error *err);
/* `reason`: a remark for the user, as what a time limit left out; "": none. */
enum status store_job_succeed(struct store *store, int64_t id, int attempt, const char *reason, struct error *err);
/* The input is at fault: a retry would not help. */
enum status store_job_fail(struct store *store, int64_t id, int attempt, const char *reason, const char *hint,
                           struct error *err);
/* Clears restart_from: the restart has been carried out. */
enum status store_job_restarted(struct store *store, int64_t id, int attempt, struct error *err);
/* The attempt crashed: back to the queue, or failed if it was the last one. memory_step is for the next attempt. */
enum status store_job_crash(struct store *store, int64_t id, int attempt, const char *reason, const char *hint,
                            int memory_step, struct error *err);
/* Nothing is heard of the attempt any more: back to the queue, and the job is not charged for it. Failed with the
 * ATTEMPTS_LOST_MAX-th in a row. */
enum status store_job_lose(struct store *store, int64_t id, int attempt, const char *reason, struct error *err);
/* The daemon stopped the attempt (a request, shutdown): back to the queue, or as requested. */
enum status store_job_stop(struct store *store, int64_t id, int attempt, const char *reason, struct error *err);
/* The attempt cannot continue until somebody acts (disk full): paused. */
enum status store_job_block(struct store *store, int64_t id, int attempt, const char *reason, const char *hint,
                            struct error *err);
/* At start: every running job of which none of kept[kept_count] is queued again (or paused, cancelled, as requested);
 * of the others the attempts that are not kept end. It does not count as a failed attempt: the job is not at fault when
 * the daemon or the machine dies. The disk usage of such a job becomes unknown. */
enum status store_reconcile(struct store *store, const struct attempt_key *kept, size_t kept_count, size_t *requeued,
                            struct error *err);

/* Two lanes, so that small renders do not wait behind hours of work. */
struct job_lane {
    double small_cost; /* renders of at most this cost (job.h) are small; 0: none is */
    bool is_small;     /* the lane of the small ones; else that of all others */
    /* Names of executors with a blank before and after each, " process slurm ": of the jobs that must run on a certain
     * one only theirs come into question. NULL: all. */
    const char *executors;
    bool anywhere; /* and those that may run on any */
};
/* The queued job to start next in that lane (NULL: there is but one), among those whose scene has been checked (ready,
 * or rejected: such a job is started only to fail); a render needs no scene. STATUS_NOT_FOUND if none. Among the users
 * with fewer than user_max_running running jobs in the lane (0: no limit), the one with the least recent CPU time; of
 * that user's jobs the one of highest priority, then the first in turn. */
enum status store_job_next(struct store *store, int user_max_running, const struct job_lane *lane, int64_t *id,
                           struct error *err);
/* The executor on which the job must run: the one that its user has chosen, JOB_EXECUTOR_HERE for all kinds but
 * reconstructions and parts of renders, "": any. The caller's (mem_free). */
enum status store_job_executor(struct store *store, int64_t id, char **executor, struct error *err);
/* Attempts that run, and what is wanted of them, for the scheduler, with every job that runs. Fills list[limit]. */
struct running {
    struct attempt_key key; /* number 0: no attempt of the job runs at this moment */
    enum job_wanted wanted; /* as the job's; and paused, where another part of it has failed or cannot go on */
};
enum status store_job_running(struct store *store, size_t limit, struct running *list, size_t *count,
                              struct error *err);
/* A queued job that must run on another executor than those (names with a blank before and after each), and whose
 * reason does not begin with `prefix`. STATUS_NOT_FOUND if none. *executor is the caller's. */
enum status store_job_unplaced(struct store *store, const char *executors, const char *prefix, int64_t *id,
                               char **executor, struct error *err);
/* Says why queued jobs wait. Sets the reason of the job `only` (0: of every queued job that has another one).
 * `reason` "": clears reasons that begin with `prefix`. Each change is a state event. */
enum status store_job_explain(struct store *store, int64_t only, const char *reason, const char *prefix,
                              const char *hint, struct error *err);

#endif
