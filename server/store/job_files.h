/* job_files.h -- files that a job's settings name and that are sent to it before it begins. As for all of the store,
 * see store.h. The files lie in the job's folder (data/layout.h); a row here says that one is there, whole.
 *
 *      store_job_add: the job is paused ──store_job_file_put of the last of its files──> queued
 *
 * 1. Which there are is fixed when the job is added. While one of them is missing the job cannot be resumed.
 * 2. Once all are there, none is replaced: what a job read is what it was sent. */
#ifndef UNBAKE_STORE_JOB_FILES_H
#define UNBAKE_STORE_JOB_FILES_H

#include <stdbool.h>
#include <stdint.h>

#include "common/error.h"

struct store;        /* store.h */
struct count_limits; /* limits.h */

#define JOB_FILES_REASON "waits for its files"
#define JOB_FILES_HINT "Send them to /v1/jobs/ID/files/NAME; `unbake render` does so."

/* Whether this file may be sent now: STATUS_NOT_FOUND when the job has none of that name, STATUS_CONFLICT when all its
 * files are there, or it has ended. */
enum status store_job_file_check(struct store *store, int64_t job_id, const char *name, struct error *err);
/* Enters a file that is in its place, durably. *queued: it was the last, and the job waits for its turn now.
 * STATUS_LIMIT where `limits` keep it from the queue: it is entered, and the job may be resumed later. The caller lets
 * no two of these calls, with what leads to them, run at once. */
enum status store_job_file_put(struct store *store, int64_t job_id, const char *name, uint64_t bytes,
                               const char *sha256, const struct count_limits *limits, bool *queued, struct error *err);

#endif
