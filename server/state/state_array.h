/* state_array.h -- what a reconstruction hands to whoever keeps its checkpoints. */
#ifndef UNBAKE_STATE_STATE_ARRAY_H
#define UNBAKE_STATE_STATE_ARRAY_H

#include <stddef.h>

/* The format of what is kept, whatever the version of the program. It grows when an array gets another meaning or layout
 * under its old name, or when one is added; whoever makes it grow has the format before read, too.
 *   1: the arrays as they are today but for the next two.
 *   2: "plan", what was planned and done of each part of the work; STATE_SURFACE. */
#define STATE_FORMAT 2

/* The name of an array of eight bytes that say what the others are laid over. Where they differ a checkpoint is of
 * another surface (the atlas is made anew by each attempt, and not the same by each version): it is of no use. */
#define STATE_SURFACE "surface"

/* A piece of state: plain memory that a checkpoint copies out and a resume copies in. */
struct state_array {
    const char *name;
    void *data;
    size_t bytes;
    int since; /* format; a checkpoint of an older one does not have it */
};

#endif
