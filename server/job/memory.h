/* memory.h -- the smaller working set of an attempt that follows one which ran out of memory.
 *
 * Step 0 is what was asked for. Each step halves the threads and quarters the texels of an
 * iteration, which goes on from the checkpoint; the second step and all after it also halve the
 * textures, which begins anew. The result differs from what the settings alone would give: the
 * job's events and its report say what was made smaller. */
#ifndef UNBAKE_JOB_MEMORY_H
#define UNBAKE_JOB_MEMORY_H

#include "common/buf.h"
#include "common/json.h"

/* A copy of the job's settings, and its threads, as step `step` has them. Appends what is smaller
 * to *what, for people: "1 thread, texels_per_iteration 1024"; nothing where nothing is. */
cJSON *memory_reduce(const cJSON *settings, int step, int *thread_count, struct buf *what);

/* Whether step + 1 is smaller than step; then *what (appended to) is how. */
bool memory_can_reduce(const cJSON *settings, int step, int thread_count, struct buf *what);

#endif
