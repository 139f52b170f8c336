/* folder.h -- the data folder: one process at a time, whoever it is. */
#ifndef UNBAKE_ADMIN_FOLDER_H
#define UNBAKE_ADMIN_FOLDER_H

#include "common/error.h"

/* Makes the folder where it is missing and takes it for this process alone; *fd holds the lock
 * while it is open. STATUS_CONFLICT when another process has it. */
enum status folder_lock(const char *dir, int *fd, struct error *err);

#endif
