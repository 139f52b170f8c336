/* comparison.h -- observed and rendered radiance of one observation.
 *
 * To first order a surface's radiance is its base colour times its light, so observed over rendered radiance is the
 * factor by which base colour must change. The noise of that ratio is that of one estimate, where a gradient's is that
 * of a product of two. */
#ifndef UNBAKE_REFINE_COMPARISON_H
#define UNBAKE_REFINE_COMPARISON_H

#include "common/vec.h"
#include "server/scene/photograph.h"

/* By channel, relative to the radiance that the texel is expected to show. (Relative to this photograph's radiance its
 * noise would be in numerator and denominator, and the mean ratio biased by its variance.) */
struct comparison {
    float observed[3];       /* photograph, over (expected + DIFFERENCE_FLOOR * median) */
    float rendered[3];       /* render, over the same */
    float channel_weight[3]; /* weight of the channel: 1, less with noise of the photograph */
    float weight; /* weight of the observation: half where the photograph differs by the expected radiance, or by
                        * NOISE_WIDTH deviations of its noise if that is more: a highlight, or something in front */
};

/* From reference[sample_count] and radiance[sample_count] of one observation. A saturated channel that the render
 * exceeds as well counts as equal. `noise` is the standard deviation of the photograph there, `median_radiance` the
 * median of all photographs. */
struct comparison comparison_make(const struct photograph_sample *reference, const rgb *radiance, int sample_count,
                                  rgb expected, rgb noise, float median_radiance);

#endif
