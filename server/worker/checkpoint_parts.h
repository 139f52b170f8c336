/* checkpoint_parts.h -- the parts of checkpoints (checkpoint_part.h): written beside checkpoint.db for whoever carries
 * them to another machine, and taken into it where they have been carried to.
 *
 * 1. A part has what has changed since the part before; the first one of a process has all.
 * 2. A part still lies there as long as it has not been carried away. Until then no further one is written, unless it
 *    must be: a slow network makes parts rarer, and there are two at the most.
 * 3. Where the parts that are needed take more than PARTS_STRETCH times the state, or are PARTS_KEPT_MAX, the next has
 *    all of it again: whoever keeps them needs room for that much and two parts more.
 *
 * Not thread-safe. */
#ifndef UNBAKE_WORKER_CHECKPOINT_PARTS_H
#define UNBAKE_WORKER_CHECKPOINT_PARTS_H

#include <stdbool.h>

#include "common/error.h"
#include "server/state/state_array.h"
#include "server/worker/checkpoint_file.h"

#define PARTS_STRETCH 2
#define PARTS_KEPT_MAX 64 /* open files of a reader */

struct checkpoint_parts; /* the writer; opaque */

/* Writes into the folder `dir`, from number `next` on. */
struct checkpoint_parts *checkpoint_parts_new(const char *dir, int next);
void checkpoint_parts_free(struct checkpoint_parts *p); /* NULL is allowed */

/* A part that was written; number 0: none was. */
struct written_part {
    int number, first; /* parts before `first` are no longer needed */
    uint64_t bytes;
};
/* Writes a part of the arrays as they have just been committed to `f`. */
enum status checkpoint_parts_write(struct checkpoint_parts *p, const struct checkpoint_file *f,
                                   const struct state_array *array, size_t count, bool must, struct written_part *part,
                                   struct error *err);

/* Makes the parts that lie in `dir` the commit of `f`, in one transaction, and then removes them. note[0] is 0, or a
 * sentence for the user on why they are not used; f is as it was then. *next: the number that no part has had. */
enum status checkpoint_parts_take(struct checkpoint_file *f, const char *dir, int *next, char note[512],
                                  struct error *err);

#endif
