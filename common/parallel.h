/* parallel.h -- the engine's only threads: a fixed pool that runs loops.
 *
 * Chunks are handed out in order but finish in any order, so a body must write only to places
 * that belong to its own index. Results then depend on neither the number of threads nor on
 * timing; what must be summed across indices is summed afterwards, in index order, or as whole numbers, atomically. */
#ifndef UNBAKE_COMMON_PARALLEL_H
#define UNBAKE_COMMON_PARALLEL_H

#include <stddef.h>

struct parallel; /* a pool; opaque */

/* A pool of `thread_count` threads, the caller's included (1: everything runs in the caller).
 * 0 asks for one per processor that this process may use. */
struct parallel *parallel_new(int thread_count);
void parallel_free(struct parallel *pool);
int parallel_thread_count(const struct parallel *pool);

/* Calls body(user, index, thread) for every index in [0, count), each once; returns when all
 * have returned. thread is in [0, thread_count) and names a slot for scratch memory: no two
 * bodies with the same slot run at once. Not reentrant: a body must not call it. */
void parallel_for(struct parallel *pool, size_t count, void (*body)(void *user, size_t index, int thread),
                  void *user);

#endif
