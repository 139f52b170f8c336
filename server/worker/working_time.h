/* working_time.h -- the time that this process really had, in seconds: what a time limit is kept by.
 *
 * Between two calls it is the processor time of the calling thread, which takes part in all parallel work, or that of
 * all threads over their number, whichever is more; and never more than has passed. So it is the time on the wall where
 * nothing else runs; what other processes take, a SIGSTOP, a frozen cgroup, a suspended machine and a paused job do not
 * count. Neither does waiting for files: a worker reads its scene at once and waits for little else. */
#ifndef UNBAKE_WORKER_WORKING_TIME_H
#define UNBAKE_WORKER_WORKING_TIME_H

struct working_time {
    int thread_count;
    double sum_sec;
    double wall_sec, thread_sec, process_sec; /* at the last call */
};

/* Starts the clock, for work on that many threads. */
void working_time_init(struct working_time *w, int thread_count);
/* Working time since then; call it on the thread that called working_time_init. */
double working_time_sec(struct working_time *w);

#endif
