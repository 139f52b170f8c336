/* scheduler.h -- decides what runs, starts workers, reads their messages, reaps them. Runs in scheduler_run on the
 * daemon's main thread, around poll(2). Other threads change the store and call scheduler_wake. */
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

/* `config`'s pointers and the store are borrowed. Fails where no descriptor is left. */
enum status scheduler_new(struct scheduler **s, const struct scheduler_config *config, struct store *store,
                          struct error *err);
void scheduler_free(struct scheduler *s);
/* Before scheduler_run: what a failed check has unpacked goes to `trash` (borrowed), so that no job waits for its
 * removal. */
void scheduler_use_trash(struct scheduler *s, struct trash *trash);
/* Reconciles the store, then works until scheduler_stop. Before it returns, running workers write checkpoints and
 * their jobs are queued again. */
enum status scheduler_run(struct scheduler *s, struct error *err);
void scheduler_wake(struct scheduler *s);                             /* look at the store again; any thread */
void scheduler_stop(struct scheduler *s);                             /* any thread, or a signal handler */
bool scheduler_waits_for_disk(const struct scheduler *s);             /* any thread */
const struct counters *scheduler_counters(const struct scheduler *s); /* any thread */
int scheduler_running(const struct scheduler *s);                     /* workers alive; any thread */
/* Number of rounds, for any thread. It must grow after scheduler_wake; otherwise the scheduler hangs. */
unsigned long scheduler_rounds(const struct scheduler *s);

#endif
