/* nearest.h -- the valid name that a mistyped one was probably meant to be. */
#ifndef UNBAKE_CLIENT_NEAREST_H
#define UNBAKE_CLIENT_NEAREST_H

#include <stddef.h>

/* Offers `candidate` as a correction of `typed`: it replaces *best when it is nearer than what
 * is there (start with *best = NULL). Names further off than a third of the longer one's length
 * plus one are no correction; a name that `typed` begins counts as one edit away. */
struct nearest {
    const char *typed;
    const char *best; /* NULL while nothing is near; borrowed */
    size_t distance;
};
void nearest_init(struct nearest *n, const char *typed);
void nearest_offer(struct nearest *n, const char *candidate);

#endif
