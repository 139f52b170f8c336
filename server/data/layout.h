/* layout.h -- what lies where in the data folder (DATA). Every path below it is made here.
 *
 *   DATA/state.db        the database (server/store), with SQLite's -wal and -shm
 *   DATA/reserve         room that is given up on a full disk (store/reserve.c)
 *   DATA/lock            locked by the daemon (folder.h)
 *   DATA/admin.sock      on which the daemon answers its administrator (server/admin)
 *   DATA/scenes/ID/      archive: the bundle as it was uploaded; files/: unpacked; files.json: a list of them, once
 *                        a node has asked for it; previews/NAME: pictures that its check drew; job.json,
 *                        worker.log: of its check
 *   DATA/jobs/ID/        worker.log: what the workers of all attempts printed; files/NAME: what was sent to it
 *                        (store/job_files.h); attempt-N/ (attempt_folder.h):
 *                        job.json: the worker's order; checkpoint/: what a later attempt goes on from, checkpoint.db
 *                        or, as a node has sent it, part-N; out/NAME: outputs
 *   DATA/uploads/ID      an upload that is not a scene yet
 *   DATA/trash/          what is being removed (trash.h), and files that no restart needs
 *
 * Each function returns a path, which is the caller's (mem_free). Where `data_dir` is NULL, the path is relative to
 * DATA. `work_dir` is the folder that a worker is started in: a scene's, an attempt's or a message's. */
#ifndef UNBAKE_DATA_LAYOUT_H
#define UNBAKE_DATA_LAYOUT_H

#include <stdbool.h>
#include <stdint.h>

#define LAYOUT_STATE "state.db"
#define LAYOUT_SOCKET "admin.sock"
#define LAYOUT_RANDOM "XXXXXX" /* for mkostemp, in place of an id */

char *layout_state(const char *data_dir);
char *layout_reserve(const char *data_dir);
char *layout_lock(const char *data_dir);
char *layout_socket(const char *data_dir);
char *layout_probe(const char *data_dir); /* a test file of `unbaked doctor`; for mkostemp */

char *layout_scenes(const char *data_dir);
char *layout_scene(const char *data_dir, const char *scene_id);
char *layout_jobs(const char *data_dir);
char *layout_job(const char *data_dir, int64_t job_id);
char *layout_job_files(const char *data_dir, int64_t job_id);
char *layout_job_file(const char *data_dir, int64_t job_id, const char *name);
char *layout_attempt(const char *data_dir, int64_t job_id, int number); /* a work_dir */
int layout_attempt_number(const char *name);                            /* N of "attempt-N"; 0: it is no such name */
char *layout_uploads(const char *data_dir);
char *layout_upload(const char *data_dir, const char *upload_id);
char *layout_trash(const char *data_dir);
char *layout_trash_file(const char *data_dir, const char *name);
char *layout_message(const char *data_dir, int64_t message_id); /* the work_dir of a webhook's message */

char *layout_order(const char *work_dir);
char *layout_log(const char *dir); /* of a job, a scene or a message */
char *layout_archive(const char *work_dir);
char *layout_files(const char *work_dir);
char *layout_file_list(const char *work_dir); /* of what lies in files/ (scene_files.h) */
char *layout_truth(const char *room);         /* the list of objects in a bundle that comes with the truth */
char *layout_previews(const char *work_dir);
char *layout_preview(const char *work_dir, const char *name);
char *layout_checkpoint_folder(const char *work_dir); /* what lies in it moves together */
char *layout_checkpoint(const char *work_dir);
char *layout_checkpoint_journal(const char *work_dir);
bool layout_is_checkpoint(const char *name);                  /* of the database or its journal */
char *layout_part(const char *checkpoint_folder, int number); /* DIR/part-N, of a checkpoint that travels */
int layout_part_number(const char *name);                     /* N of "part-N"; 0: it is no such name */
/* The names that a checkpoint had in a job's folder before attempts had folders of their own, and that of a
 * checkpoint's folder to which they are being moved. */
char *layout_former_checkpoint(const char *job_dir);
char *layout_former_journal(const char *job_dir);
char *layout_checkpoint_unready(const char *work_dir);
char *layout_out(const char *work_dir);
char *layout_output(const char *work_dir, const char *name);

#endif
