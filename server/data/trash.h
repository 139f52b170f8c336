/* trash.h -- removes files and trees: moves them to DATA/trash/ at once and deletes them on a thread of its own, so
 * that nobody waits, or holds a lock, while a tree of 100,000 files is deleted. */
#ifndef UNBAKE_DATA_TRASH_H
#define UNBAKE_DATA_TRASH_H

#include <stdbool.h>

#include "common/error.h"

struct trash; /* opaque; thread-safe */

/* Starts the thread. data_dir is borrowed and must contain trash/, whose content is deleted. `emptied` is called on
 * the thread whenever everything is deleted. */
enum status trash_new(struct trash **t, const char *data_dir, void (*emptied)(void *user), void *user,
                      struct error *err);
void trash_free(struct trash *t); /* the rest is deleted after the next start; NULL is allowed */
/* DATA/`path` is gone on return; absent is no error. Where a full disk prevents the move, it is deleted at once. */
enum status trash_take(struct trash *t, const char *path, struct error *err);
bool trash_is_busy(struct trash *t);
void trash_wait(struct trash *t); /* until everything possible is deleted; for tests */

#endif
