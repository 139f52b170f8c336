/* robust.h -- the weighted mean of measurements of which some are wrong. */
#ifndef UNBAKE_RECONSTRUCT_ROBUST_H
#define UNBAKE_RECONSTRUCT_ROBUST_H

#include <stddef.h>

#include "common/vec.h"

struct robust_sample {
    rgb value;
    float gray;   /* what outliers are told by: the logarithm of a brightness */
    float weight; /* above 0 */
};

/* The mean of count > 0 samples, those off the weighted median of `gray` counting less: half at a
 * distance of `scale` (Cauchy's weight). Sorts the samples. */
rgb robust_mean(struct robust_sample *sample, size_t count, float scale);

#endif
