/* worker_messages.h -- turns a worker's lines into events, outputs and counters, and notes in the attempt what it
 * says of its own end. The worker has parsed untrusted files: what can be checked is checked. */
#ifndef UNBAKE_JOB_WORKER_MESSAGES_H
#define UNBAKE_JOB_WORKER_MESSAGES_H

#include "server/job/attempt.h"

/* Reads what has arrived, and notices the worker's end. */
void worker_messages_read(struct attempt *a, struct store *store, struct counters *counters);

/* Enters announced files for which the store had failed; those that fail again are kept. */
enum status worker_messages_retry(struct attempt *a, struct store *store, struct error *err);

#endif
