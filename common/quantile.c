/* quantile.c -- see quantile.h. */
#include "common/quantile.h"

#include <stdlib.h>

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

float quantile(float *value, size_t count, double share) {
    if (count == 0)
        return 0.0f;
    qsort(value, count, sizeof *value, ascending);
    return value[index_of(count, share)];
}

double quantile_double(double *value, size_t count, double share) {
    if (count == 0)
        return 0.0;
    qsort(value, count, sizeof *value, ascending_double);
    return value[index_of(count, share)];
}
