/* quantile.h -- quantiles of a sample. */
#ifndef UNBAKE_COMMON_QUANTILE_H
#define UNBAKE_COMMON_QUANTILE_H

#include <stdbool.h>
#include <stddef.h>

/* Standard deviations of normal values in their median absolute deviation: 1 over the third quartile of the standard
 * normal distribution, .67449. (capture/noise.c: a quarter less, +.04 dB on the demo room.) */
#define QUANTILE_DEVIATIONS_PER_MAD 1.4826

/* value[share x count] in ascending order, share in [0, 1]: 0.5 is the (upper) median. 0 for an empty sample.
 * Reorders the values; none may be NaN. In time proportional to their number; doubles are sorted. */
float quantile(float *value, size_t count, double share);
double quantile_double(double *value, size_t count, double share);

/* A value, or a lower bound of it (censored). */
struct bounded {
    float value;
    bool is_bound;
};

/* Median of a sample with randomly censored values (Kaplan and Meier 1958). False, and the largest value, when at
 * least half of the sample may lie beyond what is known; 0 for an empty sample. Sorts the values; none may be NaN. */
bool quantile_bounded_median(struct bounded *value, size_t count, float *median);

#endif
