/* job_file.h -- opens files of DATA/jobs/, which workers write: no part of a path may be a symbolic link. */
#ifndef UNBAKE_DATA_JOB_FILE_H
#define UNBAKE_DATA_JOB_FILE_H

#include <stdint.h>

#include "common/error.h"

/* Open a job's output, or its worker's log, for reading, one part of the path after the other; *fd is the caller's, -1 on
 * errors. A pipe is opened, too, and waits for nobody. */
enum status job_file_open_output(const char *data_dir, int64_t job_id, const char *name, int *fd, struct error *err);
enum status job_file_open_log(const char *data_dir, int64_t job_id, int *fd, struct error *err);

#endif
