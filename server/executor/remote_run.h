/* remote_run.h -- what remote_runs.c, which keeps the runs, shares with remote_follow.c, which judges by what the site
 * says. */
#ifndef UNBAKE_EXECUTOR_REMOTE_RUN_H
#define UNBAKE_EXECUTOR_REMOTE_RUN_H

#include "server/executor/job_status.h"
#include "server/executor/remote.h"
#include "server/store/remote.h"

#define REMOTE_TOKEN_DIGITS 64 /* hex digits of an attempt's token: 256 bits, nobody guesses it */
#define REMOTE_NAME_DIGITS 8   /* that end its name, so that no two submissions of an attempt have one */

enum submit_state {
    SUBMISSION_SENT,   /* the command is on its way */
    SUBMISSION_DONE,   /* it is in the site's queue, or was */
    SUBMISSION_DOUBTED /* it failed, or a daemon died meanwhile: it may have come through or not */
};

struct remote_run {
    struct run run; /* first */
    struct remote *remote;
    struct remote_run *next;
    struct remote_row row; /* as last read */
    enum submit_state submission;
    int tries;            /* submissions so far */
    double submitted_at;  /* listings that began before it say nothing */
    double heard_at;      /* of its node; before that, when it was submitted or resumed */
    int absent_count;     /* good listings in a row without it, while its submission is doubted */
    int unknown_count;    /* good listings in a row in which it is not alive */
    enum site_state gone; /* what the last of these said; SITE_UNKNOWN: nothing */
    double memory_bytes;  /* as in struct run_work */
    char fault[200];      /* why the last submission failed */
    bool has_verdict;     /* it has ended, as this side judges; `verdict` says how */
    bool is_closed;       /* and nobody writes any more */
    bool is_told_silent;  /* the job may show that its node is silent */
    bool has_unread;      /* there are lines that are not read yet */
    struct run_end verdict;
};

struct remote {
    struct remote_face {
        struct executor executor; /* first */
        struct remote *remote;
    } face;
    struct remote_parts parts;
    struct remote_run *runs; /* all that are alive */
    bool asking;             /* a status command is on its way */
    double ask_at;           /* when the next one is due, should one be needed */
    uint64_t changes;        /* of the store, up to which the rows were read */
    bool must_look;          /* rows must be read again for another reason */
    double retry_at;         /* after a fault of the store; 0: none */
    bool complained;         /* the log says that commands fail */
    struct remote_figures figures;
};

/* Sends the run's submission, under the name that its row has. */
void remote_submit(struct remote_run *r, const char *token);
/* Sends a status command if one is due and any run needs it. */
void remote_query_status(struct remote *remote);
/* What has come back: takes all commands that are done. */
void remote_receive(struct remote *remote);
/* Judges runs by how long they have been silent. */
void remote_judge(struct remote *remote);
/* When the next thing is due without anybody calling. */
double remote_due(const struct remote *remote);
void remote_cancel(struct remote_run *r);
void remote_decide(struct remote_run *r, enum run_way way, int code, const char *format, ...)
    __attribute__((format(printf, 4, 5)));

#endif
