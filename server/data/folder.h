/* folder.h -- the data folder: one process at a time, whoever it is, and for its user alone. */
#ifndef UNBAKE_DATA_FOLDER_H
#define UNBAKE_DATA_FOLDER_H

#include "common/error.h"

/* Makes the folder where it is missing and takes it for this process alone; *fd holds the lock
 * while it is open. STATUS_CONFLICT when another process has it. From now on no file that the process makes, or a
 * worker of it, may be read by other users (umask 077). */
enum status folder_lock(const char *dir, int *fd, struct error *err);

/* Takes from other users, and from the folder's group, what a folder of an earlier version, or one that was made by hand,
 * lets them do with it and with what is directly in it; the log says so. What cannot be changed is told, too. */
void folder_close_to_others(const char *dir);

#endif
