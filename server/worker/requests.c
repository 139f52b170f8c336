/* requests.c -- see requests.h. */
#include "server/worker/requests.h"

#include <poll.h>
#include <signal.h>
#include <time.h>

#include "common/clock.h"

#define HANG_UP_INTERVAL_SEC 1.0 /* between two looks at whether the daemon is still there */

static void signals_of_ours(sigset_t *set) {
    sigemptyset(set);
    sigaddset(set, SIGTERM);
    sigaddset(set, SIGUSR1);
}

void requests_init(struct requests *r, int pipe_fd) {
    sigset_t set;
    *r = (struct requests){.pipe_fd = pipe_fd};
    signals_of_ours(&set);
    sigprocmask(SIG_BLOCK, &set, NULL);
}

/* Whether the pipe has no reader: the daemon has died without killing this process. */
static bool hung_up(struct requests *r) {
    double now = clock_sec();
    if (r->pipe_fd < 0 || now < r->next_look)
        return false;
    r->next_look = now + HANG_UP_INTERVAL_SEC;
    struct pollfd pipe = {.fd = r->pipe_fd};
    return poll(&pipe, 1, 0) == 1 && (pipe.revents & POLLERR);
}

bool requests_poll(struct requests *r) {
    static const struct timespec at_once = {0, 0};
    sigset_t set;
    int number;
    signals_of_ours(&set);
    while ((number = sigtimedwait(&set, NULL, &at_once)) > 0) {
        if (number == SIGTERM)
            r->stop = true;
        else
            r->preview = true;
    }
    if (hung_up(r))
        r->stop = true;
    return r->stop;
}
