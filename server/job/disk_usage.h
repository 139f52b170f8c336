/* disk_usage.h -- how much disk the folders of jobs and scenes take, for the limit on what users keep (store.h).
 *
 * A scene is measured when it is ready, a job when an attempt ends or its checkpoint is removed. Before a change the
 * size is entered as unknown (a running job counts as unknown), so that the next start measures what a killed daemon
 * did not get to. */
#ifndef UNBAKE_JOB_DISK_USAGE_H
#define UNBAKE_JOB_DISK_USAGE_H

#include "server/job/scheduler_config.h"
#include "server/store/store.h"

/* Size of the folder in bytes; -1 where it cannot be read, which is logged. */
int64_t disk_usage_of_folder(const char *dir);

/* Measures `dir` and enters the size for the job. */
enum status disk_usage_enter_job(struct store *store, int64_t job_id, const char *dir, struct error *err);

/* At start, when nothing runs: measures everything of unknown size. Failures are logged; those stay unknown. */
void disk_usage_enter_unknown(const struct scheduler_config *config, struct store *store);

#endif
