/* run.c -- see run.h. */
#include "server/job/run.h"

#include <math.h>

#include "common/mem.h"

void run_read(struct run *run, run_line_fn *each, void *user) {
    if (run)
        run->kind->read(run, each, user);
}

void run_ask(struct run *run, enum run_request request) {
    if (run)
        run->kind->ask(run, request);
}

bool run_ended(struct run *run, struct run_end *end, run_line_fn *each, void *user) {
    return run && run->kind->ended(run, end, each, user);
}

double run_cpu_sec(const struct run *run) { return run ? run->kind->cpu_sec(run) : 0.0; }

char *run_log_tail(const struct run *run, size_t limit) {
    return run ? run->kind->log_tail(run, limit) : mem_strdup("");
}

size_t run_poll(const struct run *run, struct pollfd fds[RUN_FDS], double *look_sec) {
    *look_sec = (double)INFINITY;
    return run ? run->kind->poll(run, fds, look_sec) : 0;
}

void run_free(struct run *run) {
    if (run)
        run->kind->free(run);
}
