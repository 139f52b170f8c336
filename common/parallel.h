/* parallel.h -- the engine's only threads: a fixed pool that runs parallel loops.
 *
 * Indices are handed out in order but finish in any order, so a body must write only to data of its own index.
 * Results then do not depend on the number of threads or on timing; sums across indices are computed afterwards in
 * index order, or atomically in integers. */
#ifndef UNBAKE_COMMON_PARALLEL_H
#define UNBAKE_COMMON_PARALLEL_H

#include <stddef.h>

struct parallel; /* a pool; opaque */

/* `thread_count` threads including the caller's (1: everything runs in the caller); 0: one per processor available to
 * the process. */
struct parallel *parallel_new(int thread_count);
void parallel_free(struct parallel *pool);
int parallel_thread_count(const struct parallel *pool);

/* Calls body(user, index, thread) for every index in [0, count), each once; returns when all
 * have returned. thread is in [0, thread_count) and names a slot for scratch memory: no two
 * bodies with the same slot run at once. Not reentrant: a body must not call it. */
void parallel_for(struct parallel *pool, size_t count, void (*body)(void *user, size_t index, int thread), void *user);

#endif
