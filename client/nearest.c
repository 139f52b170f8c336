/* nearest.c -- see nearest.h. Optimal string alignment distance: insertion, deletion,
 * replacement and exchange of two neighbours cost one each. */
#include "client/nearest.h"

#include <string.h>

#define LONGEST 48 /* longer words are never corrected */

static size_t least(size_t a, size_t b) {
    return a < b ? a : b;
}

static size_t distance(const char *a, size_t a_length, const char *b, size_t b_length) {
    size_t rows[3][LONGEST + 1];
    size_t *before = rows[0], *above = rows[1], *row = rows[2];
    for (size_t j = 0; j <= b_length; j++)
        above[j] = j;
    for (size_t i = 1; i <= a_length; i++) {
        row[0] = i;
        for (size_t j = 1; j <= b_length; j++) {
            size_t replaced = above[j - 1] + (a[i - 1] != b[j - 1]);
            row[j] = least(replaced, least(above[j], row[j - 1]) + 1);
            if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
                row[j] = least(row[j], before[j - 2] + 1);
        }
        size_t *spare = before;
        before = above;
        above = row;
        row = spare;
    }
    return above[b_length];
}

void nearest_init(struct nearest *n, const char *typed) {
    *n = (struct nearest){.typed = typed};
}

void nearest_offer(struct nearest *n, const char *candidate) {
    size_t typed_length = strlen(n->typed), length = strlen(candidate);
    if (typed_length == 0 || typed_length > LONGEST || length > LONGEST)
        return;
    size_t edits = distance(n->typed, typed_length, candidate, length);
    if (typed_length >= 2 && typed_length < length && memcmp(n->typed, candidate, typed_length) == 0)
        edits = least(edits, 1);
    size_t longer = typed_length > length ? typed_length : length;
    if (edits > longer / 3 + 1 || edits >= longer)
        return;
    if (!n->best || edits < n->distance) {
        n->best = candidate;
        n->distance = edits;
    }
}
