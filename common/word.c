/* word.c -- see word.h. */
#include "common/word.h"

#include <stdint.h>
#include <string.h>

size_t word_distance(const char *a, const char *b) {
    size_t row[WORD_MAX_LENGTH + 1];
    size_t n = strlen(b);
    if (n > WORD_MAX_LENGTH || strlen(a) > WORD_MAX_LENGTH)
        return SIZE_MAX;
    for (size_t j = 0; j <= n; j++)
        row[j] = j;
    for (size_t i = 1; a[i - 1]; i++) {
        size_t diagonal = row[0];
        row[0] = i;
        for (size_t j = 1; j <= n; j++) {
            size_t best = diagonal + (a[i - 1] != b[j - 1]);
            if (row[j] + 1 < best)
                best = row[j] + 1;
            if (row[j - 1] + 1 < best)
                best = row[j - 1] + 1;
            diagonal = row[j];
            row[j] = best;
        }
    }
    return row[n];
}

bool word_is_near(const char *typed, size_t distance) {
    return distance <= 2 + strlen(typed) / 4;
}
