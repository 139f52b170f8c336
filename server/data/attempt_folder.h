/* attempt_folder.h -- the folders of a job's attempts, DATA/jobs/ID/attempt-N/: out/ with the files that it writes,
 * checkpoint/ with what a later attempt goes on from.
 *
 * A checkpoint is checkpoint.db with its journal, or the parts that a node has sent (part-N): each part is written
 * once, and the newest says from which number on they are needed.
 *
 * 1. At most one attempt of a job has a checkpoint; jobs that are split (store/parts.h) have none. The next one takes
 *    it over when it begins, by one rename: the database and its journal are never apart, and whoever had it before has
 *    lost it.
 * 2. An output belongs to the attempt that wrote it, and a row of state.db says which. A file that no row names is seen
 *    by nobody, and goes when its attempt has ended; but the records of what is done (picture_record.h) stay.
 * 3. Nobody but an attempt changes its folder while it runs. */
#ifndef UNBAKE_DATA_ATTEMPT_FOLDER_H
#define UNBAKE_DATA_ATTEMPT_FOLDER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "server/store/store.h"

/* The numbers of the attempts that have folders, ascending; *numbers is the caller's (mem_free). */
enum status attempt_folder_list(const char *data_dir, int64_t job_id, int **numbers, size_t *count, struct error *err);
/* Whether the attempt's folder `work_dir` holds a checkpoint. */
enum status attempt_folder_has_checkpoint(const char *work_dir, bool *exists, struct error *err);

/* Makes the attempt's folder with all that it begins with, durably. No other attempt of the job may run. */
enum status attempt_folder_begin(const char *data_dir, int64_t job_id, int number, struct error *err);
/* The same for one of a part of a job that is split (store/parts.h): others may run, and it takes nothing of theirs. */
enum status attempt_folder_begin_part(const char *data_dir, int64_t job_id, int number, struct error *err);

/* Gives the attempt, which has just begun, what earlier ones have left in out/, the newest of each name: as hard links,
 * so that it costs no space and what others read stays; their records of what is done become its own. Its worker judges
 * what is whole. What cannot be linked is left out and made again. No other attempt of the job may run. */
enum status attempt_folder_carry_outputs(const char *data_dir, int64_t job_id, int number, struct error *err);

/* The folder of the attempt that has a checkpoint, relative to data_dir; the caller's (mem_free). NULL: none has. */
enum status attempt_folder_with_checkpoint(const char *data_dir, int64_t job_id, char **work_dir, struct error *err);
/* Removes the checkpoint; without one it does nothing. */
enum status attempt_folder_drop_checkpoint(const char *data_dir, int64_t job_id, struct error *err);

/* Of an attempt to which part `number` of a checkpoint has been added: removes what it makes needless, the parts before
 * `first` and a database, which is older. */
enum status attempt_folder_drop_older(const char *data_dir, int64_t job_id, int attempt, int first, struct error *err);
/* The names of the files of the attempt's checkpoint, in the order in which they are to be copied; the caller's
 * (file_free_names). */
enum status attempt_folder_list_checkpoint(const char *data_dir, int64_t job_id, int attempt, char ***names,
                                           size_t *count, struct error *err);
/* Whether a file of a checkpoint may have that name. */
bool attempt_folder_is_checkpoint_name(const char *name);

/* How many of the `count` pictures from `first` on earlier attempts have done one after another (picture_record.h). */
enum status attempt_folder_pictures_done(const char *data_dir, int64_t job_id, const char *digest, int64_t first,
                                         int64_t count, int64_t *done, struct error *err);

/* At start: gives attempts of a version before 17 of state.db, whose files lay in their job's folder, folders of their
 * own. One that is interrupted goes on at the next start. */
enum status attempt_folder_adopt(const char *data_dir, struct store *store, struct error *err);

#endif
