/* housekeeping.h -- what is of no use any more, removed by the scheduler: what time alone makes superfluous,
 * now and then, and what a process that was killed left. */
#ifndef UNBAKE_JOB_HOUSEKEEPING_H
#define UNBAKE_JOB_HOUSEKEEPING_H

#include "server/job/scheduler_config.h"
#include "server/store/store.h"

/* Removes the checkpoints of jobs that succeeded longer than checkpoint_keep_sec ago (those of all
 * others stay, since a retry goes on from them) and the events of jobs that ended longer than
 * event_keep_sec ago. Failures are logged. */
void housekeeping_run(const struct scheduler_config *config, struct store *store);

/* Removes what a killed process was writing in the folder of a job or scene, and in its outputs: files that
 * had not got their names yet (common/file.h). Nobody works there any more. Failures are logged. */
void housekeeping_drop_temporary(const char *dir);
/* The same for all jobs that the store says run, though none does: after the daemon was killed. */
void housekeeping_after_kill(const struct scheduler_config *config, struct store *store);

/* Removes DIR's checkpoint. */
enum status housekeeping_drop_checkpoint(const char *dir, struct error *err);

#endif
