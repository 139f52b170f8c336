/* hearing.h -- what a worker says while it lives: its lines become events, outputs and figures, and what it
 * says of its own end is noted in the attempt. It has read a stranger's files: nothing that can be checked is
 * believed. */
#ifndef UNBAKE_JOB_HEARING_H
#define UNBAKE_JOB_HEARING_H

#include "server/job/attempt.h"

/* Reads what there is, and notices the worker's end. */
void hearing_listen(struct attempt *a, struct store *store, struct figures *figures);

/* Enters the files that were announced while the store failed; those that still cannot be stay for another try. */
enum status hearing_make_up(struct attempt *a, struct store *store, struct error *err);

#endif
