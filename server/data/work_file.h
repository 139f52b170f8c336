/* work_file.h -- opens files of DATA/jobs/ and DATA/scenes/, which workers write: no component of a path may be a
 * symbolic link. */
#ifndef UNBAKE_DATA_WORK_FILE_H
#define UNBAKE_DATA_WORK_FILE_H

#include <stdbool.h>
#include <stdint.h>

#include "common/error.h"

/* Open the output that an attempt wrote, a job's log or a picture of a scene for reading, component by component; *fd
 * is the caller's, -1 on errors. Opening a FIFO does not block. */
enum status work_file_open_output(const char *data_dir, int64_t job_id, int attempt, const char *name, int *fd,
                                  struct error *err);
enum status work_file_open_log(const char *data_dir, int64_t job_id, int *fd, struct error *err);
/* A file of a checked scene. */
enum status work_file_open_scene(const char *data_dir, const char *scene_id, const char *name, int *fd,
                                 struct error *err);
/* A file that was sent with a job. */
enum status work_file_open_job_file(const char *data_dir, int64_t job_id, const char *name, int *fd, struct error *err);
/* A file in an attempt's folder checkpoint/. */
enum status work_file_open_checkpoint(const char *data_dir, int64_t job_id, int attempt, const char *name, int *fd,
                                      struct error *err);
enum status work_file_open_preview(const char *data_dir, const char *scene_id, const char *name, int *fd,
                                   struct error *err);
/* Whether a checked scene came with the truth that evaluations compare with. */
bool work_file_has_truth(const char *data_dir, const char *scene_id);

#endif
