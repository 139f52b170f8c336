/* attempt.h -- one attempt of a job or check of a scene, from its folder to the entry of its outcome in the store: what
 * is known of it, and its start. Where it runs, an executor knows (run.h). What it says is heard by worker_messages.h,
 * how it ends is judged by outcome.h.
 *
 *      empty ──start──> alive ──(its run ends)──> ended ──settle──> empty
 *
 * 1. A job's attempt is in the store (store/attempts.h) before its run begins, and its outcome is entered after the run
 *    has ended: of one job, or of each part of one that is split (store/parts.h), there is never more than one run.
 * 2. What a worker says is checked where it can be: it has parsed untrusted files.
 * 3. settle can fail (the disk of state.db is full): the attempt stays ended and is settled
 *    again later; nothing of the outcome is lost. */
#ifndef UNBAKE_JOB_ATTEMPT_H
#define UNBAKE_JOB_ATTEMPT_H

#include "common/json.h"
#include "server/job/counters.h"
#include "server/job/run.h"
#include "server/job/scheduler_config.h"
#include "server/store/store.h"

enum attempt_phase { ATTEMPT_EMPTY, ATTEMPT_ALIVE, ATTEMPT_ENDED };

struct attempt {
    enum attempt_phase phase;
    int64_t job_id;                  /* 0: the check of a scene */
    enum job_kind kind;              /* of the job */
    int64_t owner_id;                /* the owner of the job or scene */
    double charged_sec;              /* CPU time that was charged to that user */
    const struct executor *executor; /* borrowed */
    int number;                      /* fences what is written for the job */
    struct job_part part;            /* of the job, that it does */
    char scene_id[SCENE_ID_SIZE];
    char *reading;                  /* with which a scene is checked, JSON; owned; NULL for a job */
    uint64_t user_max_bytes;        /* as in scheduler_config, for the check of a scene */
    const char *data_dir;           /* borrowed */
    char *dir;                      /* that its worker writes to: the attempt's, or the scene's */
    char *whole_dir;                /* what counts as its owner's: the job's with all attempts, or the scene's */
    struct run *run;                /* owned; NULL before its start */
    struct run_end end;             /* when ended */
    bool stopping;                  /* it was asked to stop */
    bool killed;                    /* as this daemon asked */
    double kill_at_sec;             /* as clock_sec; 0: never */
    char *settings;                 /* the job's, as submitted; owned; NULL for a check */
    double memory_bytes;            /* that it is foretold to need; 0: not known */
    int thread_count, memory_step;  /* as ordered, and how often that was reduced */
    long event_count, event_max;    /* reports so far; above event_max they are thinned */
    double thinned_at;              /* when the last thinned report was entered, as clock_sec */
    bool said_thinned, said_unread; /* an event, and a line of the log, say so */
    double iteration, rays;         /* the newest values reported; negative iteration: none yet */
    bool complained;                /* the log says that a report could not be entered */
    /* Reported by the worker: */
    bool has_end;
    enum status end_status;
    char *end_message, *end_hint;
    cJSON *plan;             /* that the job is better done in parts; NULL: it has not said so */
    cJSON *problems, *facts; /* of a scene */
    long problems_left_out;  /* problems beyond the number that is kept */
    cJSON *untaken;          /* announced files that are still to be entered; NULL: none */
    cJSON *late_progress;    /* the newest, if it is still to be entered; NULL: none */
};

/* Starts a job that is queued in the store. STATUS_OK: it has left the queue; the attempt is alive or, where the
 * input is at fault, the disk is full or a user was faster, still empty. Otherwise the job is queued again and an
 * immediate retry is pointless. */
enum status attempt_start_job(struct attempt *a, const struct scheduler_config *config, struct store *store,
                              struct counters *counters, int64_t job_id, int thread_count, struct error *err);
/* Takes up an attempt of a job, which config->executor runs and an earlier daemon has started. STATUS_NOT_FOUND where
 * it does not run there. */
enum status attempt_resume_job(struct attempt *a, const struct scheduler_config *config, struct store *store,
                               const struct attempt_key *key, struct error *err);
/* Starts the check of a scene, which is in `checking` and stays there if this fails. */
enum status attempt_start_check(struct attempt *a, const struct scheduler_config *config, struct store *store,
                                const struct unchecked *scene, int thread_count, struct error *err);

/* Charges the CPU time since the last call to the owner. Where the store fails, the time is kept and charged later. */
void attempt_charge(struct attempt *a, struct store *store, struct counters *counters);

void attempt_empty(struct attempt *a); /* forgets everything */

#endif
