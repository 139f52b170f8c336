/* folder.h -- the data folder: one process at a time, whoever it is, and for its user alone; the room on its disk. */
#ifndef UNBAKE_DATA_FOLDER_H
#define UNBAKE_DATA_FOLDER_H

#include <pthread.h>
#include <stdint.h>

#include "common/error.h"

struct trash; /* trash.h */

/* What those share who add to the folder or remove from it. */
struct folder {
    const char *dir; /* borrowed */
    struct trash *trash;
    /* Held while a scene's row and its file appear or disappear together, and from the check of free room to the entry
     * that takes it: two at once would both find room. */
    pthread_mutex_t scene_mutex;
};

/* Makes what is missing of the folders in `dir` (borrowed) and starts the trash, of which `emptied` and `user` are. *f is
 * to be closed in any case. */
enum status folder_open(struct folder *f, const char *dir, void (*emptied)(void *user), void *user, struct error *err);
void folder_close(struct folder *f); /* one that is all 0 is fine */
/* STATUS_NO_SPACE, with a hint, where the disk would have less than `keep` bytes free after `bytes` more. */
enum status folder_check_room(const struct folder *f, uint64_t keep, uint64_t bytes, struct error *err);

/* Makes the folder where it is missing and takes it for this process alone; *fd holds the lock
 * while it is open. STATUS_CONFLICT when another process has it. From now on no file that the process makes, or a
 * worker of it, may be read by other users (umask 077). */
enum status folder_lock(const char *dir, int *fd, struct error *err);

/* Takes from other users, and from the folder's group, what a folder of an earlier version, or one that was made by hand,
 * lets them do with it and with what is directly in it; the log says so. What cannot be changed is told, too. */
void folder_close_to_others(const char *dir);

#endif
