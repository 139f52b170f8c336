/* run.h -- the work of one attempt, wherever it is done: it starts, says lines, may be asked, ends once. Who does it is
 * an executor's affair: process.h is the one on this machine.
 *
 *      executor->start ──> going ──(run_ended is true, once)──> ended ──run_free──>
 *
 * 1. An executor is told names and numbers, and folders relative to the data folder: no path, process or descriptor of
 *    this machine means anything where a run may be.
 * 2. What a run writes lies in its folder of the data folder, whole, before a line is heard that tells of it.
 * 3. Once it has ended nothing of it writes there any more.
 *
 * Not thread-safe. No call waits for the run. */
#ifndef UNBAKE_JOB_RUN_H
#define UNBAKE_JOB_RUN_H

#include <poll.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "common/json.h"

enum run_request {
    RUN_STOP,   /* at its next step, after a checkpoint */
    RUN_KILL,   /* at once */
    RUN_PREVIEW /* pictures of what there is, soon */
};

enum run_way {
    RUN_EXIT,     /* it ended by itself, with a status of server/worker/progress.h */
    RUN_SIGNAL,   /* a signal ended it */
    RUN_MEMORY,   /* where it ran, memory ran out, and the system chose it */
    RUN_LOST,     /* nothing is known of it any more */
    RUN_REFUSED,  /* where it was to run, it was not taken */
    RUN_PREEMPTED /* its place was wanted for others; there may be a checkpoint */
};

struct run_end {
    enum run_way way;
    int code;         /* RUN_EXIT: the status; RUN_SIGNAL: its number */
    char reason[256]; /* RUN_LOST, _REFUSED, _PREEMPTED: why; for users */
};

/* What is to be done; borrowed until start returns. */
struct run_work {
    const char *folder;   /* in which it is done: a scene's, an attempt's or a message's; exists */
    const char *log;      /* file to which is appended what it prints */
    const char *scene_id; /* whose files it reads; NULL: none */
    const char *outputs;  /* folder of another job's outputs that it reads; NULL: none */
    const char *files;    /* folder of files that were sent to the job; NULL: none */
    cJSON *order;         /* server/worker/order.h; the executor adds where scene, outputs and files lie */
    int64_t job_id;       /* 0: it is no job's */
    int attempt;          /* of the job */
    double memory_bytes;  /* that it is foretold to need; 0: not known */
};

typedef void run_line_fn(void *user, const char *line, size_t length); /* without the newline */

#define RUN_FDS 2 /* descriptors of a run, at most */

struct run; /* the executor's */

struct run_kind {
    void (*read)(struct run *run, run_line_fn *each, void *user);
    void (*ask)(struct run *run, enum run_request request);
    bool (*ended)(struct run *run, struct run_end *end, run_line_fn *each, void *user);
    double (*cpu_sec)(const struct run *run);
    char *(*log_tail)(const struct run *run, size_t limit);
    size_t (*poll)(const struct run *run, struct pollfd fds[RUN_FDS], double *look_sec);
    void (*free)(struct run *run);
};

struct run { /* an executor's own begins with it */
    const struct run_kind *kind;
    char place[64];    /* for the daemon's log: "process 123" */
    size_t long_lines; /* lines dropped because they were longer than PROGRESS_LINE_MAX */
    bool outlives;     /* it goes on without this daemon, and a later one resumes it */
    double slow_sec;   /* how much later than at once it may hear what it is asked */
};

struct executor {     /* likewise */
    const char *name; /* in state.db: at most 31 bytes */
    int max_running;  /* jobs at once */
    enum status (*start)(const struct executor *executor, const struct run_work *work, struct run **run,
                         struct error *err);
    /* The run of an attempt that an earlier daemon has started; STATUS_NOT_FOUND: it was none, or cannot go on. NULL:
     * no run outlives its daemon. */
    enum status (*resume)(const struct executor *executor, int64_t job_id, int attempt, struct run **run,
                          struct error *err);
};

/* All of these take NULL for a run that never was: it says nothing and does not end. */

/* Passes every complete line that has arrived to `each`. */
void run_read(struct run *run, run_line_fn *each, void *user);
void run_ask(struct run *run, enum run_request request);
/* True, once, when the run has ended. By then the rest of its lines has gone through `each`. */
bool run_ended(struct run *run, struct run_end *end, run_line_fn *each, void *user);
/* CPU time so far, or in all. */
double run_cpu_sec(const struct run *run);
/* The last lines that it printed, at most `limit` bytes, joined into one line of ASCII; the caller's (mem_free), "" if
 * none. */
char *run_log_tail(const struct run *run, size_t limit);
/* The descriptors that become readable when there is something to read or to end; returns their number. *look_sec: look
 * after so much time all the same; infinite: never. */
size_t run_poll(const struct run *run, struct pollfd fds[RUN_FDS], double *look_sec);
void run_free(struct run *run); /* it must have ended, or outlives the daemon */

#endif
