/* confine.h -- the two layers of the sandbox, each by itself; see sandbox.h, which puts them together.
 *
 * Both hold for the calling thread and what it starts from then on, both need PR_SET_NO_NEW_PRIVS, and
 * neither can be left again. Each returns false where this kernel does not have it. */
#ifndef UNBAKE_WORKER_CONFINE_H
#define UNBAKE_WORKER_CONFINE_H

#include <stdbool.h>
#include <stdint.h>

#define SANDBOX_READ_DIRS                                                                                              \
    2 /* folders that a worker may read besides its own: a scene's or outputs, and a job's files */
/* What a process may still do. */
struct sandbox {
    const char *write_dir;                   /* NULL: none */
    const char *read_dir[SANDBOX_READ_DIRS]; /* NULL: none */
    uint16_t connect_port;                   /* of the server that it connects to; 0: no network */
    uint64_t memory_bytes;                   /* 0: no limit */
};

/* Landlock: which files may be read and written (Linux 5.13), which TCP port may be connected to (6.7); no signals
 * to other processes and no abstract Unix sockets (6.12). Skips what the kernel is too old for. */
bool confine_files(const struct sandbox *sandbox);

/* seccomp: allows the system calls in confine_calls.c, with the arguments given there; all others fail with ENOSYS.
 * `network` adds those needed to resolve a name and talk to a server. */
bool confine_calls(bool network);

#define CONFINE_VERSION_SIZE 24
void confine_library_version(char text[CONFINE_VERSION_SIZE]); /* of libseccomp: "2.5.4" */

/* After confine_calls(true): no more sockets and no more connections. */
bool confine_to_connection(void);

#endif
