/* scheduler_config.h -- limits on jobs and workers, and how long things are kept. */
#ifndef UNBAKE_JOB_SCHEDULER_CONFIG_H
#define UNBAKE_JOB_SCHEDULER_CONFIG_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct executor; /* run.h */

struct scheduler_config {
    const char *data_dir;                 /* borrowed; holds scenes/ID/, jobs/ID/ */
    const struct executor *executor;      /* borrowed; runs jobs, checks of scenes and what calls webhooks (run.h) */
    const struct executor *const *places; /* [place_count] where jobs may run, in this order; borrowed (executors.h) */
    size_t place_count;                   /* 0: only `executor` */
    int max_running;                      /* jobs at once on `executor` */
    int small_renders;                    /* small renders at once, besides; 0: they wait with the other jobs */
    int small_render_threads;             /* shared between these; 0: all processors */
    double small_render_cost;             /* paths that a small render traces at the most (job.h) */
    double render_part_cost;              /* paths of a part of a larger render; 0: it is one */
    int user_max_running;                 /* attempts of jobs of one user at once; 0: no limit */
    int max_checks;                       /* checks of scenes at once; 0: CHECKS_AT_ONCE */
    int thread_count;                     /* shared between running jobs; 0: all processors */
    uint64_t user_max_bytes;              /* what one user may keep; 0: no limit */
    uint64_t jobs_memory_bytes;           /* for all running jobs, as foretold; 0: what is free when none runs */
    uint64_t worker_memory_bytes;         /* 0: no limit */
    uint64_t photograph_memory_bytes;     /* of it for pixels of photographs; 0: half of what there is */
    double checkpoint_interval_sec;
    double stop_grace_sec;      /* from the request to stop to the end by force */
    double checkpoint_keep_sec; /* after the job has succeeded */
    double event_keep_sec;      /* after the job has ended */
    long attempt_events_max;    /* reports of one attempt before they are thinned; 0: 500,000 */
    uint64_t low_disk_bytes;    /* work waits while less is free; 0: never */
    bool webhook_private;       /* webhooks may go to private addresses */
    bool sandbox;
};

#endif
