/* quantile.c -- see quantile.h. */
#include "common/quantile.h"

#include <stdlib.h>

static int ascending(const void *a, const void *b) {
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

float quantile(float *value, size_t count, double share) {
    if (count == 0)
        return 0.0f;
    qsort(value, count, sizeof *value, ascending);
    size_t at = (size_t)(share * (double)count);
    return value[at < count ? at : count - 1];
}
