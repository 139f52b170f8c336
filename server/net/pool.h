/* pool.h -- a queue of tasks and a few threads that do them, in order of arrival. */
#ifndef UNBAKE_NET_POOL_H
#define UNBAKE_NET_POOL_H

#include <stddef.h>

#include "common/error.h"

struct task {
    void (*run)(struct task *task); /* may free the task, or queue it again */
    struct task *next;              /* the pool's own */
};

struct pool; /* opaque; thread-safe */

/* `name` is the threads' name, at most 15 bytes. */
enum status pool_new(struct pool **p, const char *name, size_t thread_count, struct error *err);
void pool_give(struct pool *p, struct task *task); /* borrowed until it has run; never blocks */
/* Runs all queued tasks first, and those that they queue. NULL is allowed. */
void pool_free(struct pool *p);

#endif
