/* censored.h -- quantiles of values of which some are known to be lower bounds only: saturated pixels.
 *
 * The least absolute deviation with censored values (Powell 1984; other shares as Powell 1986): a bound pulls
 * upwards what is below it and lets be what is above. */
#ifndef UNBAKE_CAPTURE_CENSORED_H
#define UNBAKE_CAPTURE_CENSORED_H

#include <stdbool.h>
#include <stddef.h>

struct censored {
    float value, weight; /* weight above 0 */
    bool is_bound;
};

/* The value below which `share` of the weight lies. Sorts the values; there must be one. *is_bound: it is
 * a bound. */
float censored_quantile(struct censored *value, size_t count, float share, bool *is_bound);

#endif
