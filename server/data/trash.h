/* trash.h -- files and trees on their way out: moved to DATA/trash/ at once, removed by a thread of its own. So nobody
 * waits, or holds a lock, while a tree of 100,000 files is taken apart. */
#ifndef UNBAKE_DATA_TRASH_H
#define UNBAKE_DATA_TRASH_H

#include <stdbool.h>

#include "common/error.h"

struct trash; /* opaque; thread-safe */

/* Starts the thread on data_dir (borrowed), whose folder trash/ must be there; what an earlier life left in it goes.
 * `emptied` is called on the thread each time that there is nothing left. */
enum status trash_new(struct trash **t, const char *data_dir, void (*emptied)(void *user), void *user,
                      struct error *err);
void trash_free(struct trash *t); /* what is left then is removed after the next start; NULL is fine */
/* DATA/`path` is gone when this returns; absent is no error. Where even that takes room that a full disk lacks, it is
 * removed at once. */
enum status trash_take(struct trash *t, const char *path, struct error *err);
bool trash_is_busy(struct trash *t);
void trash_wait(struct trash *t); /* until all is removed that can be. For tests. */

#endif
