/* robust.h -- the weighted mean of measurements of which some are wrong. */
#ifndef UNBAKE_RECONSTRUCT_ROBUST_H
#define UNBAKE_RECONSTRUCT_ROBUST_H

#include <stddef.h>

#include "common/vec.h"

struct robust_sample {
    rgb value;
    float gray;   /* what outliers are told by: the logarithm of a brightness */
    float weight; /* above 0 */
    float noise, mixing; /* of the value, see denoise.h; not looked at here */
};

/* Lowers the weights of those of count > 0 samples that are off the weighted median of `gray`: to half
 * at a distance of `scale` (Cauchy's weight). Sorts the samples. Returns the sum of the weights. */
float robust_weigh(struct robust_sample *sample, size_t count, float scale);

/* The mean of count > 0 samples after robust_weigh. */
rgb robust_mean(struct robust_sample *sample, size_t count, float scale);

#endif
