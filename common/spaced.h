/* spaced.h -- evenly spaced choices from a list. */
#ifndef UNBAKE_COMMON_SPACED_H
#define UNBAKE_COMMON_SPACED_H

#include <stddef.h>

/* The place of the i-th of `wanted` evenly spaced items of `count`, 1 <= wanted; i == wanted gives count, so consecutive
 * places also bound `wanted` parts of the list whose sizes differ by at most one. i * count must fit size_t. */
static inline size_t spaced(size_t i, size_t count, size_t wanted) { return i * count / wanted; }

#endif
