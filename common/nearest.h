/* nearest.h -- the valid name that a mistyped one was probably meant to be. */
#ifndef UNBAKE_COMMON_NEAREST_H
#define UNBAKE_COMMON_NEAREST_H

#include <stddef.h>

/* Offer every valid name; `best` is then the one that is fewest edits (Levenshtein) away, the
 * first of equals. Names further off than a third of the longer one's length plus one are no
 * correction, nor are names of more than 63 bytes; a name that `typed` begins counts as one edit
 * away. */
struct nearest {
    const char *typed; /* borrowed */
    const char *best;  /* NULL while nothing is near; borrowed */
    size_t distance;
};

void nearest_init(struct nearest *n, const char *typed);
void nearest_offer(struct nearest *n, const char *candidate);

#endif
