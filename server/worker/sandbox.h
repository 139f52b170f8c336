/* sandbox.h -- what a worker gives up before it reads what a stranger uploaded.
 *
 *  - files: it may read `read_dir` and the system's libraries, and write below `write_dir`
 *    (Landlock, Linux 5.13 and later);
 *  - network, new programs, other processes: refused (seccomp);
 *  - memory: private memory is limited (RLIMIT_DATA; allocation then fails and mem.h ends the
 *    process with its own exit status);
 *  - core dumps: none. They would hold the scene.
 *
 * Nothing here fails: what this kernel cannot do is named, and the worker goes on. */
#ifndef UNBAKE_WORKER_SANDBOX_H
#define UNBAKE_WORKER_SANDBOX_H

#include <stdbool.h>
#include <stdint.h>

struct sandbox {
    const char *write_dir;
    const char *read_dir;  /* NULL: none */
    bool network;          /* it may call others, and read what finding them takes */
    uint64_t memory_bytes; /* 0: no limit */
};

struct sandbox_result {
    bool files, system_calls, memory;
    char text[256]; /* a sentence for the job's log */
};

/* For the calling thread and what it starts from now on: call it before the first thread. */
void sandbox_enter(const struct sandbox *sandbox, struct sandbox_result *result);

#endif
