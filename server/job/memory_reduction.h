/* memory_reduction.h -- a smaller working set for the attempt after one that ran out of memory.
 *
 * Step 0 is what was submitted. Each step halves the threads and quarters the texels of an iteration; such an attempt
 * resumes from the checkpoint. From step 2 on the textures are halved too, and the attempt starts over. The result
 * differs from that of the settings as submitted: the job's events and its report say what was reduced. */
#ifndef UNBAKE_JOB_MEMORY_REDUCTION_H
#define UNBAKE_JOB_MEMORY_REDUCTION_H

#include "common/buf.h"
#include "common/json.h"
#include "server/job/job.h"

/* A copy of the job's settings, and its threads, after `step` reductions. Appends to *what, for people, what is
 * smaller: "1 thread, texels_per_iteration 1024"; nothing if nothing is. */
cJSON *memory_reduction_apply(enum job_kind kind, const cJSON *settings, int step, int *thread_count, struct buf *what);

/* Whether another reduction is possible; *what (appended to) describes it. */
bool memory_reduction_is_possible(enum job_kind kind, const cJSON *settings, int step, int thread_count,
                                  struct buf *what);

#endif
