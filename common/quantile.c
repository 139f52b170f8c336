/* quantile.c -- see quantile.h. */
#include "common/quantile.h"

#include <stdlib.h>

#define STEPS_MAX 100 /* of a selection: on average each leaves half, and 2^64 values are more than there can be */

static int ascending(const void *a, const void *b) {
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

static int ascending_double(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static size_t index_of(size_t count, double share) {
    size_t at = (size_t)(share * (double)count);
    return at < count ? at : count - 1;
}

static float median_of_three(float a, float b, float c) {
    return a < b ? (b < c ? b : a < c ? c : a) : (a < c ? a : b < c ? c : b);
}

/* Moves the values below the bound (not above it, where `inclusive`) to the front; returns how many. No branch depends
 * on a value: of a random sample half of them would be predicted wrongly, which takes longer than all else. */
static size_t partition(float *value, size_t count, float bound, bool inclusive) {
    size_t below = 0;
    for (size_t i = 0; i < count; i++) {
        float here = value[i];
        value[i] = value[below];
        value[below] = here;
        below += inclusive ? here <= bound : here < bound;
    }
    return below;
}

/* The value that would be at index `at` in ascending order (Hoare 1961, Algorithm 65: Find). Samples on which the
 * halving fails, which only somebody who wants it can make, are sorted. */
static float select_value(float *value, size_t count, size_t at) {
    for (int step = 0; step < STEPS_MAX; step++) {
        float pivot = median_of_three(value[0], value[count / 2], value[count - 1]);
        size_t below = partition(value, count, pivot, false);
        if (at < below) {
            count = below;
            continue;
        }
        value += below;
        at -= below;
        count -= below;
        size_t equal = partition(value, count, pivot, true);
        if (at < equal)
            return pivot;
        value += equal;
        at -= equal;
        count -= equal;
    }
    qsort(value, count, sizeof *value, ascending);
    return value[at];
}

float quantile(float *value, size_t count, double share) {
    return count == 0 ? 0.0f : select_value(value, count, index_of(count, share));
}

double quantile_double(double *value, size_t count, double share) {
    if (count == 0)
        return 0.0;
    qsort(value, count, sizeof *value, ascending_double);
    return value[index_of(count, share)];
}

/* Among equal values, the bound counts as larger. */
static int ascending_bounded(const void *a, const void *b) {
    const struct bounded *x = a, *y = b;
    if (x->value != y->value)
        return x->value < y->value ? -1 : 1;
    return x->is_bound - y->is_bound;
}

bool quantile_bounded_median(struct bounded *value, size_t count, float *median) {
    double larger = 1.0; /* estimated share of values larger than those visited */
    qsort(value, count, sizeof *value, ascending_bounded);
    *median = count > 0 ? value[count - 1].value : 0.0f;
    for (size_t i = 0; i < count; i++) {
        if (value[i].is_bound)
            continue;
        larger *= 1.0 - 1.0 / (double)(count - i);
        if (larger < 0.5) {
            *median = value[i].value;
            return true;
        }
    }
    return false;
}
