/* censored.h -- quantiles of values of which some are lower bounds (saturated pixels).
 *
 * Least absolute deviation with censored values (Powell 1984; other quantiles: Powell 1986): a bound pulls the estimate
 * up while the estimate is below it, and has no effect otherwise. For few observations, weighted; medians of many by
 * Kaplan and Meier are quantile.h's. */
#ifndef UNBAKE_CAPTURE_CENSORED_H
#define UNBAKE_CAPTURE_CENSORED_H

#include <stdbool.h>
#include <stddef.h>

struct censored {
    float value, weight; /* weight above 0 */
    bool is_bound;
};

/* The value below which `share` of the weight lies. Sorts the values; count > 0. *is_bound: the result is a lower
 * bound. */
float censored_quantile(struct censored *value, size_t count, float share, bool *is_bound);

#endif
