/* scheduler_config.h -- what jobs and their workers may take, and how long things wait and stay. */
#ifndef UNBAKE_JOB_SCHEDULER_CONFIG_H
#define UNBAKE_JOB_SCHEDULER_CONFIG_H

#include <stdbool.h>
#include <stdint.h>

struct scheduler_config {
    const char *data_dir;         /* borrowed; holds scenes/ID/, jobs/ID/ */
    const char *worker_binary;    /* /proc/self/exe */
    int max_running;              /* jobs at once */
    int user_max_running;         /* of them, of one user; 0: all */
    int max_checks;               /* of scenes, at once; 0: CHECKS_AT_ONCE */
    int thread_count;             /* shared between running jobs; 0: all processors */
    uint64_t user_max_bytes;      /* that one user keeps; 0: no limit */
    uint64_t worker_memory_bytes; /* 0: no limit */
    double checkpoint_interval_sec;
    double stop_grace_sec;      /* SIGTERM to SIGKILL */
    double checkpoint_keep_sec; /* of a job that has succeeded */
    double event_keep_sec;      /* of a job that has ended */
    long attempt_events_max;    /* that one attempt reports before they are thinned; 0: 500,000 */
    uint64_t low_disk_bytes;    /* with less free space, work waits; 0: never */
    bool webhook_private;       /* webhooks may go to private addresses */
    bool sandbox;
};

#endif
