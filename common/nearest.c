/* nearest.c -- see nearest.h. */
#include "common/nearest.h"

#include <stdbool.h>
#include <string.h>

#define LENGTH_MAX 63 /* bytes of a name that is compared */

static size_t least(size_t a, size_t b, size_t c) {
    size_t least_two = a < b ? a : b;
    return least_two < c ? least_two : c;
}

/* Levenshtein distance of words of at most LENGTH_MAX bytes in which two neighbours that were swapped count as one edit
 * (optimal string alignment, Damerau 1964). Three rows of its table are kept. */
static size_t distance(const char *a, const char *b) {
    size_t rows[3][LENGTH_MAX + 1], length = strlen(b), i;
    for (size_t j = 0; j <= length; j++)
        rows[0][j] = j;
    for (i = 1; a[i - 1]; i++) {
        size_t *row = rows[i % 3];
        const size_t *above = rows[(i - 1) % 3], *swapped = rows[(i + 1) % 3]; /* one row and two rows before */
        row[0] = i;
        for (size_t j = 1; j <= length; j++) {
            row[j] = least(above[j - 1] + (a[i - 1] != b[j - 1]), above[j] + 1, row[j - 1] + 1);
            bool is_swap = i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1];
            if (is_swap && swapped[j - 2] + 1 < row[j])
                row[j] = swapped[j - 2] + 1;
        }
    }
    return rows[(i - 1) % 3][length];
}

void nearest_init(struct nearest *n, const char *typed) { *n = (struct nearest){.typed = typed}; }

void nearest_offer(struct nearest *n, const char *candidate) {
    size_t typed_length = strlen(n->typed), length = strlen(candidate);
    size_t longer = typed_length > length ? typed_length : length, shorter = typed_length + length - longer;
    size_t edits_max = longer / 3 + 1;
    if (longer > LENGTH_MAX)
        return;
    bool begins = typed_length >= 2 && typed_length < length && memcmp(n->typed, candidate, typed_length) == 0;
    if (!begins && longer - shorter > edits_max) /* the distance is no less */
        return;
    size_t edits = begins ? 1 : distance(n->typed, candidate);
    if (edits > edits_max || 2 * edits > longer)
        return;
    if (!n->best || edits < n->distance) {
        n->best = candidate;
        n->distance = edits;
    }
}

void nearest_tell(const struct nearest *n, const char *where, const char *kind, struct buf *problems) {
    buf_printf(problems, "%s: unknown %s \"%s\"%s%s%s\n", where, kind, n->typed, n->best ? "; did you mean " : "",
               n->best ? n->best : "", n->best ? "?" : "");
}
