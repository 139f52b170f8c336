/* confine.h -- the two layers of the sandbox, each by itself; see sandbox.h, which puts them together.
 *
 * Both hold for the calling thread and what it starts from then on, both need PR_SET_NO_NEW_PRIVS, and
 * neither can be left again. Each returns false where this kernel does not have it. */
#ifndef UNBAKE_WORKER_CONFINE_H
#define UNBAKE_WORKER_CONFINE_H

#include <stdbool.h>
#include <stdint.h>

/* What a process keeps. */
struct sandbox {
    const char *write_dir; /* NULL: none */
    const char *read_dir;  /* NULL: none */
    uint16_t connect_port; /* of the server that it calls; 0: no network */
    uint64_t memory_bytes; /* 0: no limit */
};

/* Landlock: which files may be read and written (Linux 5.13), which TCP port may be called (6.7), and that
 * no signal and no abstract Unix socket leads out (6.12). What a kernel is too old for is left out. */
bool confine_files(const struct sandbox *sandbox);

/* seccomp: the system calls of the list in confine_calls.c, with the arguments given there; all others fail
 * with ENOSYS. With `network` also those that resolve a name and talk to a server. */
bool confine_calls(bool network);

/* On top of confine_calls(true): no further socket and no further connection. */
bool confine_to_connection(void);

#endif
