/* pool.h -- a queue of tasks and a few threads that do them, in order of arrival. */
#ifndef UNBAKE_NET_POOL_H
#define UNBAKE_NET_POOL_H

#include <stddef.h>

#include "common/error.h"

struct task {
    void (*run)(struct task *task); /* may free the task, or give it to a pool again */
    struct task *next;              /* the pool's */
};

struct pool; /* opaque; thread-safe */

/* `name`, of at most 15 bytes, is that of the threads. */
enum status pool_new(struct pool **p, const char *name, size_t thread_count, struct error *err);
void pool_give(struct pool *p, struct task *task); /* borrowed until it has run; never waits */
/* What was given is done first, also what that gives. NULL is fine. */
void pool_free(struct pool *p);

#endif
