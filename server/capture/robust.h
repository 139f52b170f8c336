/* robust.h -- the weighted mean of measurements of which some are wrong. */
#ifndef UNBAKE_CAPTURE_ROBUST_H
#define UNBAKE_CAPTURE_ROBUST_H

#include <stddef.h>
#include <stdint.h>

#include "common/vec.h"

struct robust_sample {
    rgb value;
    float gray;      /* what outliers are told by: the logarithm of a brightness */
    float deviation; /* standard deviation of `gray` by noise alone, as far as is known */
    float weight;    /* above 0 */
    /* Not looked at here: */
    uint32_t source; /* which photograph */
    float sharp;     /* solid angle per area of surface */
    rgb noise;       /* of the value, as the next; see denoise.h */
    float mixing;
};

/* Lowers the weights of those of count > 0 samples that are off the median of `gray`, weighed by their weights to the
 * power `trust` in [0, 1]: to half at a distance of `scale`, or further off where noise alone goes that far (Cauchy's
 * weight). Sorts the samples. Returns the sum of the weights. */
float robust_weigh(struct robust_sample *sample, size_t count, float trust, float scale);

/* Keeps those of count > 0 samples whose `gray` is less than `within` off its median, whatever their weights: what most
 * of them show. Sorts the samples; returns how many are kept. */
size_t robust_keep(struct robust_sample *sample, size_t count, float within);

/* The mean of count > 0 samples after robust_weigh with a trust of 1. */
rgb robust_mean(struct robust_sample *sample, size_t count, float scale);

#endif
