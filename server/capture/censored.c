/* censored.c -- see censored.h. */
#include "server/capture/censored.h"

#include <stdlib.h>

static int compare(const void *a, const void *b) {
    const struct censored *x = a, *y = b;
    return x->value != y->value ? (x->value > y->value) - (x->value < y->value) : x->is_bound - y->is_bound;
}

float censored_quantile(struct censored *value, size_t count, float share, bool *is_bound) {
    qsort(value, count, sizeof *value, compare);
    float above = 0.0f, below = 0.0f; /* weight that pulls up and down */
    for (size_t i = 0; i < count; i++)
        above += value[i].weight;
    size_t i = 0;
    for (; i + 1 < count; i++) {
        above -= value[i].weight;
        below += value[i].is_bound ? 0.0f : value[i].weight;
        if ((1.0f - share) * below >= share * above)
            break;
    }
    *is_bound = value[i].is_bound;
    return value[i].value;
}
