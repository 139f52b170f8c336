/* resume.h -- what a daemon finds running in the store when it starts. */
#ifndef UNBAKE_JOB_RESUME_H
#define UNBAKE_JOB_RESUME_H

#include "server/job/executors.h"

/* Attempts that go on without a daemon are taken up, each in one of the empty slots; all other jobs that the store has
 * as running are queued again. */
enum status resume_all(struct attempt *slots, size_t slot_count, struct executors *places,
                       const struct scheduler_config *config, struct store *store, size_t *requeued, struct error *err);

#endif
