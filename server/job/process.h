/* process.h -- the executor on this machine: a run is a process of its own.
 *
 * The child is BINARY worker DIR, in a session of its own, with stdin from /dev/null, stdout and stderr appended to the
 * log, its pipe at PROGRESS_FD, no other descriptor, and those variables of the environment that cannot hold secrets.
 * The kernel kills it when the daemon's thread that started it ends (PR_SET_PDEATHSIG), so a dead daemon leaves no
 * writer behind; the OOM killer prefers it. Only the fork blocks. */
#ifndef UNBAKE_JOB_PROCESS_H
#define UNBAKE_JOB_PROCESS_H

#include "server/job/run.h"

struct process_executor {
    struct executor executor;
    const char *binary, *data_dir; /* borrowed */
};

/* Returns &p->executor; keeps the arguments. */
const struct executor *process_executor_init(struct process_executor *p, const char *binary, const char *data_dir);

#endif
