/* housekeeping.h -- what time alone makes superfluous, removed now and then by the scheduler. */
#ifndef UNBAKE_JOB_HOUSEKEEPING_H
#define UNBAKE_JOB_HOUSEKEEPING_H

#include "server/job/scheduler_config.h"
#include "server/store/store.h"

/* Removes the checkpoints of jobs that succeeded longer than checkpoint_keep_sec ago (those of all
 * others stay, since a retry goes on from them) and the events of jobs that ended longer than
 * event_keep_sec ago. Failures are logged. */
void housekeeping_run(const struct scheduler_config *config, struct store *store);

/* Removes DIR's checkpoint. */
enum status housekeeping_drop_checkpoint(const char *dir, struct error *err);

#endif
