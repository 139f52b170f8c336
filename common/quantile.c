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
