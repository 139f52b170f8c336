/* worker_messages.h -- what a worker reports: its lines become events, outputs and counters, and what it says of
 * its own end is noted in the attempt. It has read a stranger's files: what can be checked is checked. */
#ifndef UNBAKE_JOB_WORKER_MESSAGES_H
#define UNBAKE_JOB_WORKER_MESSAGES_H

#include "server/job/attempt.h"

/* Reads what there is, and notices the worker's end. */
void worker_messages_read(struct attempt *a, struct store *store, struct counters *counters);

/* Enters the files that were announced while the store failed; those that still cannot be stay for another try. */
enum status worker_messages_retry(struct attempt *a, struct store *store, struct error *err);

#endif
