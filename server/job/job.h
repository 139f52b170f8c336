/* job.h -- what a job is and the states it goes through.
 *
 *      queued ──> running ──> succeeded
 *        │  ▲       │ │ └───> failed      (attempts exhausted, or the input is at fault)
 *        │  └───────┘ └─────> cancelled
 *        │  (crash, restart, pre-emption: attempt + 1, resumes from the checkpoint)
 *        ├──> cancelled
 *        └──> paused ──> queued | cancelled     running ──> paused (checkpoint, then stop)
 *
 *      failed | cancelled ──> queued   only by the user's explicit retry (of a stage, also from
 *      succeeded ──> queued            succeeded) or extend: a new life of the job with its
 *                                      attempts counted from 0 again
 *
 * 1. succeeded, failed and cancelled are sinks for everything but retry and extend: exactly one is
 *    reached.
 * 2. A running job has exactly one attempt; a report that names another is refused.
 * 3. A request to a running job (pause, cancel) is recorded in `wanted` before the worker hears
 *    of it, so a crash of the daemon in between forgets nothing. */
#ifndef UNBAKE_JOB_JOB_H
#define UNBAKE_JOB_JOB_H

#include <stdbool.h>
#include <stdint.h>

#include "common/error.h"

/* Stored as numbers in state.db: the order is part of its schema. */
enum job_state { JOB_QUEUED, JOB_RUNNING, JOB_PAUSED, JOB_SUCCEEDED, JOB_FAILED, JOB_CANCELLED };
enum job_kind { JOB_RECONSTRUCT, JOB_RENDER, JOB_EVALUATE };
enum job_wanted { JOB_WANT_RUN, JOB_WANT_PAUSE, JOB_WANT_CANCEL };
enum scene_state { SCENE_RECEIVING, SCENE_CHECKING, SCENE_READY, SCENE_REJECTED };

/* Of an attempt; store/attempts.h draws how it goes through them. */
enum attempt_row_phase { ATTEMPT_ROW_FORMER, ATTEMPT_ROW_RUNNING, ATTEMPT_ROW_ENDED };

#define ENDING_SUCCEEDED "succeeded"
#define ENDING_FAILED "failed"       /* the input is at fault */
#define ENDING_CRASHED "crashed"     /* counts against the job's attempts */
#define ENDING_STOPPED "stopped"     /* by a request, or with the daemon */
#define ENDING_BLOCKED "blocked"     /* it cannot go on until somebody acts */
#define ENDING_LOST "lost"           /* nothing is heard of it: where it ran is at fault */
#define ENDING_SPLIT "split"         /* from here on attempts of parts do the work (store/parts.h) */
#define ENDING_RESTARTED "restarted" /* the daemon, or the machine, died */

#define JOB_STATE_COUNT 6
#define JOB_KIND_COUNT 3
#define SCENE_STATE_COUNT 4

/* The words of common/protocol.h. Parsing: false for an unknown word. */
const char *job_state_name(enum job_state state);
bool job_state_parse(const char *name, enum job_state *state);
const char *job_kind_name(enum job_kind kind);
bool job_kind_parse(const char *name, enum job_kind *kind);
const char *job_wanted_name(enum job_wanted wanted); /* "run", "pause", "cancel" */
const char *scene_state_name(enum scene_state state);
bool job_is_terminal(enum job_state state);
/* Whether the diagram above has an arrow between the states. */
bool job_may_become(enum job_state from, enum job_state to);

/* The stages that a retry of a job of that kind may begin with. *keeps_checkpoint: for a stage before the end of the
 * optimisation, it starts over without one. */
bool job_stage_parse(enum job_kind kind, const char *name, bool *keeps_checkpoint);
const char *job_stages(enum job_kind kind); /* all of them, for people */

#define JOB_EXECUTOR_HERE "process" /* name of the executor on this machine */

#define SCENE_ID_SIZE 65 /* the SHA-256 of the uploaded content, in hex, and the NUL */

/* A row of the jobs table. Strings are owned; job_release frees them. */
struct job {
    int64_t id;
    enum job_kind kind;
    int64_t source_id; /* the reconstruction whose outputs it reads; 0: none */
    double cost;       /* of a render: paths from the camera; 0: not known */
    char *files;      /* that its settings name: JSON array text of {"name", "bytes", "sha256"}, the last two null where
                        * one has not been sent yet */
    int64_t revision; /* grows by one with every change; in the ETag */
    char scene_id[SCENE_ID_SIZE]; /* of a render: its source's, which may be gone */
    int64_t owner_id;             /* the user who submitted it; 0: nobody */
    char *owner;                  /* that user's name; "" */
    bool is_shared;               /* with the lab: every caller may read it */
    char *name;
    char *labels;   /* JSON object text */
    char *settings; /* JSON object text, as submitted */
    int priority;   /* larger first */
    int64_t turn;   /* among jobs of one priority: smaller first */
    enum job_state state;
    enum job_wanted wanted;
    int attempt; /* of the current or last run; 0 before the first */
    int attempts_left;
    int part_count, parts_done;                  /* of one that is split (store/parts.h); else 0 */
    int64_t created_ms, started_ms, finished_ms; /* Unix time, 0: not yet */
    char *stage;                                 /* last reported; "" before */
    char *restart_from; /* the stage that the next attempt begins with; "": where the last one stopped */
    int memory_step;    /* how often its working set was reduced; see job/memory_reduction.h */
    bool is_pinned;
    int64_t expires_ms; /* Unix time as of now, 0: never; see store/retention.h */
    int64_t disk_bytes; /* size of its folder at the end of its last attempt; -1: unknown */
    double progress;    /* 0..1, of the stage */
    double eta_sec;     /* negative: unknown */
    char *delivery;     /* outcome of its messages: JSON object text; "": it has no webhook */
    char *webhook;      /* the URL that is told its states; "": none */
    char *reason;       /* why it failed or is paused, in plain words; "" if not */
    char *hint;         /* what to do about it; "" if unknown */
};

void job_release(struct job *job);

#endif
