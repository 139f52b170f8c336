/* state_array.h -- arrays of which checkpoints of a reconstruction consist. */
#ifndef UNBAKE_STATE_STATE_ARRAY_H
#define UNBAKE_STATE_STATE_ARRAY_H

#include <stddef.h>

/* Format of checkpoints, independent of the program's version. It grows when an array is added, or changes meaning or
 * layout under its name; the format before must then still be read.
 *   1: the present arrays without the following two.
 *   2: adds "plan", the planned and done amounts of each part of the work, and STATE_SURFACE.
 *   3: adds "light", the estimated sources of light.
 *   4: adds "deviation", of base colour.
 *   5: adds "light.ground", by what saturated ground was brightened: before, as the sky was.
 *   6: adds "light.deviation", of all light. */
#define STATE_FORMAT 6

/* Name of an array of eight bytes: a hash of the surface parametrisation. A checkpoint with another one cannot be used
 * (each attempt makes the atlas again, and versions of the program may differ in it). */
#define STATE_SURFACE "surface"

/* Plain memory that a checkpoint saves and a resume restores. */
struct state_array {
    const char *name;
    void *data;
    size_t bytes;
    int since; /* format; a checkpoint of an older one does not have it */
};

#endif
