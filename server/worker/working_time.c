/* working_time.c -- see working_time.h. */
#include "server/worker/working_time.h"

#include <math.h>
#include <time.h>

static double read_clock(clockid_t clock) {
    struct timespec now;
    return clock_gettime(clock, &now) == 0 ? (double)now.tv_sec + 1e-9 * (double)now.tv_nsec : 0.0;
}

static void look_at_clocks(struct working_time *w) {
    w->wall_sec = read_clock(CLOCK_MONOTONIC);
    w->thread_sec = read_clock(CLOCK_THREAD_CPUTIME_ID);
    w->process_sec = read_clock(CLOCK_PROCESS_CPUTIME_ID);
}

void working_time_init(struct working_time *w, int thread_count) {
    *w = (struct working_time){.thread_count = thread_count};
    look_at_clocks(w);
}

double working_time_sec(struct working_time *w) {
    struct working_time before = *w;
    look_at_clocks(w);
    double by_thread = w->thread_sec - before.thread_sec;
    double by_all = (w->process_sec - before.process_sec) / (double)w->thread_count;
    w->sum_sec += fmin(fmax(by_thread, by_all), w->wall_sec - before.wall_sec);
    return w->sum_sec;
}
