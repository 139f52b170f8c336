/* supervisor.h -- one worker process: start it, read its pipe, signal it, reap it.
 *
 * The child is BINARY worker DIR, in a session of its own, with stdin from /dev/null, stdout and
 * stderr appended to DIR/worker.log, its pipe at PROGRESS_FD and no other descriptor, and of the
 * environment what no secret is kept in. The kernel
 * kills it when the daemon's thread that started it ends (PR_SET_PDEATHSIG), so a dead daemon
 * leaves no writer behind; it is the first choice of the out-of-memory killer.
 *
 * Not thread-safe; nothing blocks but the fork. */
#ifndef UNBAKE_JOB_SUPERVISOR_H
#define UNBAKE_JOB_SUPERVISOR_H

#include <stdbool.h>
#include <stddef.h>
#include <sys/types.h>

#include "common/buf.h"
#include "common/error.h"

struct worker {
    pid_t pid;         /* 0: none, or reaped */
    int pid_fd;        /* readable when the process has ended; -1 where the kernel has none */
    int pipe_fd;       /* -1 after its end */
    struct buf line;   /* what has come of the present line */
    bool skipping;     /* the present line is too long: dropped up to its end */
    size_t long_lines; /* that were dropped so */
    char *log_path;
    double cpu_sec;  /* that it took in all, once it is reaped */
    off_t log_start; /* where this process's part of the log begins */
};

/* Starts the process in the folder `dir`; *w is to be reaped and released. Where it fails *w is as
 * released. Nothing of the arguments is kept. */
enum status supervisor_start(struct worker *w, const char *binary, const char *dir, struct error *err);

/* Hands every complete line that has come to `each`, without its newline. */
void supervisor_read(struct worker *w, void (*each)(void *user, const char *line, size_t length), void *user);

void supervisor_signal(struct worker *w, int signal);

/* True, once, when the process has ended: everything it left behind in its session is killed,
 * the rest of its pipe read through `each`, *wait_status is as waitpid gives it. */
bool supervisor_reap(struct worker *w, int *wait_status, void (*each)(void *user, const char *line, size_t length),
                     void *user);

/* CPU time of the process so far, or in all. */
double supervisor_cpu_sec(const struct worker *w);

/* The last lines that the process wrote to its log, at most `limit` bytes, on one line; the
 * caller's (mem_free), "" if none. */
char *supervisor_last_words(const struct worker *w, size_t limit);

void supervisor_release(struct worker *w); /* the process must be reaped */

#endif
