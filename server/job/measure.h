/* measure.h -- what the folders of jobs and scenes take of the disk, found out by looking, for the limit on what users
 * keep (store.h). Looked at when it changes: a scene when it is ready, a job when an attempt ends or its checkpoint
 * is removed. Whatever may change it is begun with the figure entered as unknown, or while the job claims to run, which
 * comes to the same: so the next start finds what a killed daemon did not come to. */
#ifndef UNBAKE_JOB_MEASURE_H
#define UNBAKE_JOB_MEASURE_H

#include "server/job/scheduler_config.h"
#include "server/store/store.h"

/* What the folder takes, in bytes; -1 where the disk cannot tell, which is logged. */
int64_t measure_folder(const char *dir);

/* Looks at `dir` and enters it for the job. */
enum status measure_job(struct store *store, int64_t job_id, const char *dir, struct error *err);

/* At start, when nothing runs: looks at all that is not known. Failures are logged; that stays unknown. */
void measure_unknown(const struct scheduler_config *config, struct store *store);

#endif
