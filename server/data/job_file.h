/* job_file.h -- opens files of DATA/jobs/, which workers write: no part of a path may be a symbolic link. */
#ifndef UNBAKE_DATA_JOB_FILE_H
#define UNBAKE_DATA_JOB_FILE_H

#include "common/error.h"

/* Opens `path` below data_dir/jobs/ for reading, one part after the other; *fd is the caller's, -1 on errors. A
 * pipe is opened, too, and waits for nobody. */
enum status job_file_open(const char *data_dir, const char *path, int *fd, struct error *err);

#endif
