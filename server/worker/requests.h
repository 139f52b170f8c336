/* requests.h -- what the daemon asks of a worker while it works: SIGTERM, stop; SIGUSR1, pictures of what there is. A
 * daemon that is gone asks to stop, too.
 *
 * The signals are blocked and asked for: no handlers, no globals. */
#ifndef UNBAKE_WORKER_REQUESTS_H
#define UNBAKE_WORKER_REQUESTS_H

#include <stdbool.h>

struct requests {
    int pipe_fd; /* to the daemon; -1: none */
    bool stop;
    bool preview;     /* the caller clears it */
    double next_look; /* whether the pipe has a reader; as clock_sec */
};

/* Blocks the signals. Before the first thread, which inherits that. */
void requests_init(struct requests *r, int pipe_fd);
/* Looks for requests; returns r->stop. Costs a system call or two. */
bool requests_poll(struct requests *r);

#endif
