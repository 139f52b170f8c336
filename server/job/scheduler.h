/* scheduler.h -- decides what runs, spawns workers, reads what they say, buries them.
 *
 * Runs on one thread (the daemon's main thread) in scheduler_run, around poll(2). Other threads
 * change the store and call scheduler_wake. */
#ifndef UNBAKE_JOB_SCHEDULER_H
#define UNBAKE_JOB_SCHEDULER_H

#include <stdbool.h>
#include <stdint.h>

#include "common/error.h"
#include "server/job/counters.h"
#include "server/job/scheduler_config.h"
#include "server/store/store.h"

struct scheduler; /* opaque */
struct trash;     /* data/trash.h */

/* Nothing runs yet. What `config` points to and the store are borrowed; fails where the system has no
 * descriptor left. */
enum status scheduler_new(struct scheduler **s, const struct scheduler_config *config, struct store *store,
                          struct error *err);
void scheduler_free(struct scheduler *s);
/* Before scheduler_run: what a failed check has unpacked goes to `trash` (borrowed), so that no job waits for its removal. */
void scheduler_use_trash(struct scheduler *s, struct trash *trash);
/* Reconciles, then works until scheduler_stop; running workers checkpoint and their jobs go back
 * to the queue before it returns. */
enum status scheduler_run(struct scheduler *s, struct error *err);
void scheduler_wake(struct scheduler *s);                             /* from any thread: look at the store again */
void scheduler_stop(struct scheduler *s);                             /* from any thread or a signal handler */
bool scheduler_waits_for_disk(const struct scheduler *s);             /* any thread */
const struct counters *scheduler_counters(const struct scheduler *s); /* any thread */
int scheduler_running(const struct scheduler *s);                     /* workers alive; any thread */
/* How often it has looked at the store; any thread. After scheduler_wake it grows, or it hangs. */
unsigned long scheduler_rounds(const struct scheduler *s);

#endif
