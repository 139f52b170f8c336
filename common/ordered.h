/* ordered.h -- parallel loops whose results are taken in the order of their indices, so that sums of them do not depend
 * on threads, and are those of a plain loop. */
#ifndef UNBAKE_COMMON_ORDERED_H
#define UNBAKE_COMMON_ORDERED_H

#include <stddef.h>

#include "common/parallel.h"

/* For every index in [0, count): make(user, index, result) fills `size` bytes at result, by any thread of the pool;
 * then take(user, index, result) is called by the caller's thread, in order. make must not see what take writes, since
 * it may run before or after it. What is made waits in memory, 65,536 results at most. */
void ordered_for(struct parallel *pool, size_t count, size_t size, void (*make)(void *user, size_t index, void *result),
                 void (*take)(void *user, size_t index, const void *result), void *user);

#endif
