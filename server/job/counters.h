/* counters.h -- counters since the daemon started, for /metrics. Written by the scheduler's thread, read by any. */
#ifndef UNBAKE_JOB_COUNTERS_H
#define UNBAKE_JOB_COUNTERS_H

#include <stdatomic.h>

/* How attempts end. */
enum attempt_end {
    END_SUCCEEDED,
    END_INPUT, /* the input was at fault */
    END_CRASHED,
    END_MEMORY,    /* it ran out of memory */
    END_STOPPED,   /* paused, cancelled, or the daemon stopped */
    END_DISK,      /* blocked until there is disk space */
    END_LOST,      /* nothing was heard of it any more */
    END_REFUSED,   /* it was not taken where it was to run */
    END_PREEMPTED, /* its place was wanted for others */
    END_COUNT
};

struct counters {
    atomic_ullong ends[END_COUNT];
    atomic_ullong first_start_count, first_wait_ms; /* jobs' first attempts, and how long they were queued */
    atomic_ullong iteration_count, ray_count;
    atomic_ullong checkpoint_count, checkpoint_us, checkpoint_bytes;
    atomic_ullong cpu_ms; /* of workers */
};

#endif
