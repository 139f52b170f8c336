/* state_array.h -- what a reconstruction hands to whoever keeps its checkpoints. */
#ifndef UNBAKE_STATE_STATE_ARRAY_H
#define UNBAKE_STATE_STATE_ARRAY_H

#include <stddef.h>

/* A piece of state: plain memory that a checkpoint copies out and a resume copies in. */
struct state_array {
    const char *name;
    void *data;
    size_t bytes;
};

#endif
