/* attempt.h -- one worker's work, from its folder to the entry of its outcome in the store: what is known of
 * it, and its start. What it says is heard by worker_messages.h, how it ends is judged by outcome.h.
 *
 *      empty ──start──> alive ──(process ends)──> ended ──settle──> empty
 *
 * 1. A job's attempt is in the store before its process exists, and its outcome is entered after
 *    the process is reaped: of one job there is never more than one process.
 * 2. What a worker says is checked where it can be: it has read a stranger's files.
 * 3. settle can fail (the disk of state.db is full): the attempt stays ended and is settled
 *    again later; nothing of the outcome is lost. */
#ifndef UNBAKE_JOB_ATTEMPT_H
#define UNBAKE_JOB_ATTEMPT_H

#include "common/json.h"
#include "server/job/counters.h"
#include "server/job/scheduler_config.h"
#include "server/job/supervisor.h"
#include "server/store/store.h"

enum attempt_phase { ATTEMPT_EMPTY, ATTEMPT_ALIVE, ATTEMPT_ENDED };

struct attempt {
    enum attempt_phase phase;
    int64_t job_id;     /* 0: the check of a scene */
    int64_t owner_id;   /* whose job or scene it is */
    double charged_sec; /* CPU time that was entered for that user */
    int number;         /* fences what is entered for the job */
    char scene_id[SCENE_ID_SIZE];
    char *reading;           /* with which a scene is checked, JSON; owned; NULL for a job */
    uint64_t user_max_bytes; /* as scheduler_config has it, for the check of a scene */
    char *dir;
    struct worker worker;
    int wait_status;                /* when ended */
    bool stopping;                  /* it was asked to stop */
    bool killed;                    /* by us */
    double kill_at_sec;             /* as clock_sec; 0: never */
    char *settings;                 /* of the job, as asked for; owned; NULL for a check */
    int thread_count, memory_step;  /* what it was to have, and how often that was made smaller */
    uint64_t oom_kills;             /* before it started */
    long event_count, event_max;    /* what it has reported; after how much of that it is thinned */
    double thinned_at;              /* when something was entered last since then, as clock_sec */
    bool said_thinned, said_unread; /* the job's events, and the log, say so */
    double iteration, rays;         /* the newest that it reported; negative iteration: none yet */
    bool complained;                /* a report could not be entered, and the log says so */
    /* What it said of itself. */
    bool has_end;
    enum status end_status;
    char *end_message, *end_hint;
    cJSON *problems, *facts; /* of a scene */
    long problems_left_out;  /* more of them than are kept */
    cJSON *untaken;          /* announced files that are still to be entered; NULL: none */
    cJSON *late_progress;    /* the newest, where that is still to be entered; NULL: none */
};

/* Starts the job, which is queued in the store. STATUS_OK: it has left the queue, and the attempt
 * is alive or (the input is at fault, the disk is full, the user was faster) still empty. Else
 * the job is in the queue again and it is of no use to try at once. */
enum status attempt_start_job(struct attempt *a, const struct scheduler_config *config, struct store *store,
                              struct counters *counters, int64_t job_id, int thread_count, struct error *err);
/* Starts the check of a scene, which is in `checking` and stays there if this fails. */
enum status attempt_start_check(struct attempt *a, const struct scheduler_config *config, struct store *store,
                                const struct unchecked *scene, int thread_count, struct error *err);

/* Enters the CPU time since the last call for the job's owner. Where the store fails, it keeps it and enters
 * it later. */
void attempt_charge(struct attempt *a, struct store *store, struct counters *counters);

void attempt_empty(struct attempt *a); /* forgets all of it */

#endif
