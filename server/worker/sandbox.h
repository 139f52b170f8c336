/* sandbox.h -- which rights a worker gives up before it parses untrusted uploads or replies.
 *
 *  - files: it may read the folders `read_dir` and the system's libraries, and write below `write_dir`
 *    (Landlock, Linux 5.13 and later); modes, owners, times and attributes of files it changes nowhere;
 *  - system calls: those of a list (seccomp). No network, no new programs, no processes of its own, nothing
 *    that reaches another process: no signals by any way, no priorities, no tracing;
 *  - a worker that calls others (`connect_port`): TCP to this port and to DNS's (Landlock, Linux 6.7 and
 *    later), UDP, no Unix sockets; once it is connected, that connection alone (sandbox_keep_connection);
 *  - memory: private memory is limited (RLIMIT_DATA; allocation then fails and mem.h ends the
 *    process with its own exit status);
 *  - core dumps: none. They would hold the scene.
 *
 * Nothing here fails: what this kernel cannot do is named, and the worker goes on. */
#ifndef UNBAKE_WORKER_SANDBOX_H
#define UNBAKE_WORKER_SANDBOX_H

#include "server/worker/confine.h"

struct sandbox_result {
    bool files, system_calls, memory;
    char text[256]; /* a sentence for the job's log */
};

/* Applies to the calling thread and what it starts later: call it before the first thread. */
void sandbox_enter(const struct sandbox *sandbox, struct sandbox_result *result);

/* After sandbox_enter with a connect_port: the process keeps its open connections and can make no others. False
 * where the system cannot enforce that. */
bool sandbox_keep_connection(void);

#endif
