/* folder.h -- the data folder: locked by one process, closed to other users; its free space. */
#ifndef UNBAKE_DATA_FOLDER_H
#define UNBAKE_DATA_FOLDER_H

#include <pthread.h>
#include <stdint.h>

#include "common/error.h"

struct trash; /* trash.h */

/* Shared by all who add to the folder or remove from it. */
struct folder {
    const char *dir; /* borrowed */
    struct trash *trash;
    /* Held while a scene's row and its file appear or disappear together, and from a check of free space until the
     * space is taken: two at once would both find room. */
    pthread_mutex_t scene_mutex;
};

/* Creates missing folders in `dir` (borrowed) and starts the trash, to which `emptied` and `user` go. *f must be
 * closed in any case. */
enum status folder_open(struct folder *f, const char *dir, void (*emptied)(void *user), void *user, struct error *err);
void folder_close(struct folder *f); /* one that is all 0 is allowed */
/* STATUS_NO_SPACE, with a hint, if less than `keep` bytes would be free after `bytes` more. */
enum status folder_check_space(const struct folder *f, uint64_t keep, uint64_t bytes, struct error *err);

/* Creates the folder if it is missing and locks it; *fd holds the lock while it is open. STATUS_CONFLICT when
 * another process has it. From then on files of this process and its workers are unreadable for other users (umask
 * 077). */
enum status folder_lock(const char *dir, int *fd, struct error *err);

/* Removes permissions of the group and of others on the folder and its direct entries, as earlier versions or
 * administrators may have set them; logs what was changed and what could not be. */
void folder_close_to_others(const char *dir);

#endif
