/* housekeeping.h -- removes what is no longer needed: old checkpoints and events, now and then, and leftovers of
 * killed processes. */
#ifndef UNBAKE_JOB_HOUSEKEEPING_H
#define UNBAKE_JOB_HOUSEKEEPING_H

#include "server/job/scheduler_config.h"
#include "server/store/store.h"

/* Removes the checkpoints of jobs that succeeded more than checkpoint_keep_sec ago (all others stay: a retry
 * continues from them) and the events of jobs that ended more than event_keep_sec ago. Failures are logged. */
void housekeeping_run(const struct scheduler_config *config, struct store *store);

/* Removes unfinished files (common/file.h) of a killed process from the folder of an attempt or scene, and from its
 * outputs. No process may be working there. Failures are logged. */
void housekeeping_drop_temporary(const char *dir);
/* Tidies all jobs that the store has as running while none is: after the daemon was killed. */
void housekeeping_after_kill(const struct scheduler_config *config, struct store *store);

/* Removes files of a job that no output names, and folders of attempts that have nothing left (data/attempt_folder.h).
 * Those of attempts that run stay as they are, but for `ended` (0: none), whose end is still to be entered. Failures
 * are logged. */
void housekeeping_clean_job(const char *data_dir, struct store *store, int64_t job_id, int ended);

#endif
