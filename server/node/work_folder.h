/* work_folder.h -- where an attempt works on a node: a folder of its own on a local disk, as a data folder that has one
 * job. It goes with the process; what a process that was killed has left goes with the next that starts there. */
#ifndef UNBAKE_NODE_WORK_FOLDER_H
#define UNBAKE_NODE_WORK_FOLDER_H

#include "common/error.h"

struct work_folder {
    char *path;  /* owned; NULL: none */
    int lock_fd; /* locked as long as the process lives */
};

/* Makes one in `base`. *folder needs work_folder_remove in any case. */
enum status work_folder_make(struct work_folder *folder, const char *base, struct error *err);
void work_folder_remove(struct work_folder *folder);

#endif
