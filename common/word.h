/* word.h -- how far a mistyped word is from the one that was meant. */
#ifndef UNBAKE_COMMON_WORD_H
#define UNBAKE_COMMON_WORD_H

#include <stdbool.h>
#include <stddef.h>

#define WORD_MAX_LENGTH 63 /* longer words are near to nothing */

/* Levenshtein distance; SIZE_MAX when either word is too long. */
size_t word_distance(const char *a, const char *b);
/* True when `typed` may well have been meant for a word at that distance. */
bool word_is_near(const char *typed, size_t distance);

#endif
