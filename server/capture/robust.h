/* robust.h -- weighted means of measurements with outliers. */
#ifndef UNBAKE_CAPTURE_ROBUST_H
#define UNBAKE_CAPTURE_ROBUST_H

#include <stddef.h>
#include <stdint.h>

#include "common/vec.h"

struct robust_sample {
    rgb value;
    float gray;      /* log brightness, by which outliers are found */
    float deviation; /* standard deviation of `gray` by noise alone, where known */
    float weight;    /* above 0 */
    /* Not used here: */
    uint32_t source; /* photograph */
    float sharp;     /* image resolution on the surface: solid angle per area */
    rgb noise;       /* of the value, as the next; see denoise.h */
    float mixing;
};

/* Cauchy weights: lowers the weights of samples off the weighted median of `gray` (weights to the power `weight_power`
 * in [0, 1]): to half at distance `scale`, or farther where noise explains it. count > 0; sorts the samples. Returns
 * the sum of the weights. */
float robust_weigh(struct robust_sample *sample, size_t count, float weight_power, float scale);

/* Keeps samples whose `gray` is less than `within` from its unweighted median. count > 0; sorts the samples; returns
 * how many are kept. */
size_t robust_select(struct robust_sample *sample, size_t count, float within);

/* Weighted mean after robust_weigh with weight_power 1; count > 0. */
rgb robust_mean(struct robust_sample *sample, size_t count, float scale);

#endif
