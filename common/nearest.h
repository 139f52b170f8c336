/* nearest.h -- suggests the valid name closest to a mistyped one. */
#ifndef UNBAKE_COMMON_NEAREST_H
#define UNBAKE_COMMON_NEAREST_H

#include <stddef.h>

#include "common/buf.h"

/* Offer every valid name; `best` is then the one with the fewest edits (letters changed, left out, added,
 * or swapped with their neighbours), the first of equals. Names further away than a third of the longer length plus
 * one, or than half of it, are not suggested, nor are names of more than 63 bytes; a name that begins with `typed`
 * counts as distance 1. */
struct nearest {
    const char *typed; /* borrowed */
    const char *best;  /* NULL while nothing is near; borrowed */
    size_t distance;
};

void nearest_init(struct nearest *n, const char *typed);
void nearest_offer(struct nearest *n, const char *candidate);

/* Adds the line "WHERE: unknown KIND "TYPED"", and the suggestion if there is one. */
void nearest_tell(const struct nearest *n, const char *where, const char *kind, struct buf *problems);

#endif
