/* job_file.h -- opens files of DATA/jobs/, which workers write: no component of a path may be a symbolic link. */
#ifndef UNBAKE_DATA_JOB_FILE_H
#define UNBAKE_DATA_JOB_FILE_H

#include <stdint.h>

#include "common/error.h"

/* Open a job's output or its worker's log for reading, component by component; *fd is the caller's, -1 on errors.
 * Opening a FIFO does not block. */
enum status job_file_open_output(const char *data_dir, int64_t job_id, const char *name, int *fd, struct error *err);
enum status job_file_open_log(const char *data_dir, int64_t job_id, int *fd, struct error *err);

#endif
