/* nearest.c -- see nearest.h. */
#include "client/nearest.h"

#include <string.h>

#include "common/word.h"

void nearest_init(struct nearest *n, const char *typed) {
    *n = (struct nearest){.typed = typed};
}

void nearest_offer(struct nearest *n, const char *candidate) {
    size_t typed_length = strlen(n->typed), length = strlen(candidate);
    size_t longer = typed_length > length ? typed_length : length;
    size_t edits = word_distance(n->typed, candidate);
    if (typed_length >= 2 && typed_length < length && memcmp(n->typed, candidate, typed_length) == 0)
        edits = 1;
    if (edits > longer / 3 + 1 || edits >= longer)
        return;
    if (!n->best || edits < n->distance) {
        n->best = candidate;
        n->distance = edits;
    }
}
