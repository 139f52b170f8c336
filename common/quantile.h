/* quantile.h -- the value below which a share of a sample lies. */
#ifndef UNBAKE_COMMON_QUANTILE_H
#define UNBAKE_COMMON_QUANTILE_H

#include <stdbool.h>
#include <stddef.h>

/* value[share x count] of the values in order, share in [0, 1]: .5 is the (upper) median. 0 when there is
 * none. Sorts the values; none may be NaN. */
float quantile(float *value, size_t count, double share);
double quantile_double(double *value, size_t count, double share);

/* A value, or a lower bound of one. */
struct bounded {
    float value;
    bool is_bound;
};

/* The median of values of which some are known by a lower bound only, that has nothing to do with how large they are
 * (Kaplan and Meier 1958). False, and the largest of all, where half of them or more may lie beyond what is known; so
 * where there are none, 0. Sorts them; none may be NaN. */
bool quantile_bounded_median(struct bounded *value, size_t count, float *median);

#endif
