/* supervisor.h -- one worker process: start it, read its pipe, signal it, reap it.
 *
 * The child is BINARY worker DIR, in a session of its own, with stdin from /dev/null, stdout and
 * stderr appended to DIR/worker.log, its pipe at PROGRESS_FD, no other descriptor, and those variables of the
 * environment that cannot hold secrets. The kernel kills it when the daemon's thread that started it ends
 * (PR_SET_PDEATHSIG), so a dead daemon leaves no writer behind; the OOM killer prefers it.
 *
 * Not thread-safe; only the fork blocks. */
#ifndef UNBAKE_JOB_SUPERVISOR_H
#define UNBAKE_JOB_SUPERVISOR_H

#include <stdbool.h>
#include <stddef.h>
#include <sys/types.h>

#include "common/buf.h"
#include "common/error.h"

struct worker {
    pid_t pid;         /* 0: none, or reaped */
    int pid_fd;        /* readable when the process has ended; -1 on old kernels */
    int pipe_fd;       /* -1 after the end of the pipe */
    struct buf line;   /* the incomplete last line */
    bool skipping;     /* the current line is too long and is dropped */
    size_t long_lines; /* number of lines dropped */
    char *log_path;
    double cpu_sec;  /* in all, once it is reaped */
    off_t log_start; /* where this process's part of the log begins */
};

/* Starts the process in the folder `dir`; *w must be reaped and released. After an error *w is as released. Keeps
 * none of the arguments. */
enum status supervisor_start(struct worker *w, const char *binary, const char *dir, struct error *err);

/* Passes every complete line that has arrived to `each`, without its newline. */
void supervisor_read(struct worker *w, void (*each)(void *user, const char *line, size_t length), void *user);

void supervisor_signal(struct worker *w, int signal);

/* True, once, when the process has ended. By then everything left in its session is killed, the rest of its pipe has
 * gone through `each`, and *wait_status is as from waitpid. */
bool supervisor_reap(struct worker *w, int *wait_status, void (*each)(void *user, const char *line, size_t length),
                     void *user);

/* CPU time of the process so far, or in all. */
double supervisor_cpu_sec(const struct worker *w);

/* The last lines in the process's log, at most `limit` bytes, joined into one line; the caller's (mem_free), "" if
 * none. */
char *supervisor_last_words(const struct worker *w, size_t limit);

void supervisor_release(struct worker *w); /* the process must be reaped */

#endif
