/* executors.h -- the executors that jobs may run on, in the order in which those come into question whose users have
 * chosen none, and how many jobs each of them has. Turns, quotas and priorities are the same for all of them: whose
 * turn it is depends on what is free only where a user has chosen. */
#ifndef UNBAKE_JOB_EXECUTORS_H
#define UNBAKE_JOB_EXECUTORS_H

#include "server/job/attempt.h"

#define EXECUTOR_REASON "its executor is not configured" /* the beginning of the reason of a job that waits for one */

struct executor_use {
    const struct executor *executor; /* borrowed */
    size_t limit, running;           /* jobs */
    bool is_for_others;              /* only for jobs that must run there: it is not in the configured list */
    bool is_closed;                  /* none begins in this round: there is no memory on this machine */
};

struct executors {
    struct executor_use *use; /* [count]; owned */
    size_t count, slots;      /* jobs at once on all of them */
};

void executors_init(struct executors *p, const struct scheduler_config *config);
void executors_release(struct executors *p);
/* The names of all, as store_job_next takes them; the caller's. */
char *executors_names(const struct executors *p);
/* Counts the attempts that are alive or still to be settled, and opens all places. */
void executors_count(struct executors *p, const struct attempt *slots, size_t count);
struct executor_use *executors_find(struct executors *p, const char *name); /* NULL: there is none of that name */
/* Where a job begins whose user has chosen `chosen` ("": nothing); NULL: nowhere at this moment. */
struct executor_use *executors_for(struct executors *p, const char *chosen);
/* One more has begun there; NULL: none. */
void executors_add(struct executors *p, const struct executor *executor);
/* The names of those where one may begin, as store_job_next takes them; the caller's. NULL: there is none. */
char *executors_available(const struct executors *p);

#endif
