/* texture_variance.h -- how much the base colour of a chart's texels varies beyond their noise.
 *
 * Texels with more weight are less noisy, but no better examples of what is around them. Where texture varies by T
 * and a texel's noise by s, it counts in means over its surroundings with 1 / (s + T), not with 1 / s: with that a
 * few texels of a patch of sun, a hundred times less noisy than the floor around, would colour it all. As between
 * studies of one effect (random effects; Paule and Mandel 1982). */
#ifndef UNBAKE_MATERIAL_TEXTURE_VARIANCE_H
#define UNBAKE_MATERIAL_TEXTURE_VARIANCE_H

#include <math.h>

#include "server/material/measurement.h"
#include "server/scene/atlas.h"
#include "server/scene/inverse_uv.h"

/* Of a chart, variances summed over the channels. */
struct texture_variance {
    float texture; /* above 0 */
    float noise;   /* a texel's by its weight: that of one with weight 1 */
};

/* [atlas->chart_count]; the caller's. */
struct texture_variance *texture_variances(const struct atlas *atlas, const struct inverse_uv *inverse,
                                           const struct measurement *measured);

/* Variance of a texel's noise, given its weight, which is above 0. Bounded: weights in the dark may be 1e-16 of usual
 * ones, and more than ten times what base colour may be tells nothing; and none is quite without noise. */
static inline float texture_variance_noise(const struct texture_variance *v, float weight) {
    return fminf(fmaxf(v->noise / weight, 1e-8f), 100.0f);
}

/* Its weight in means over its surroundings, in (0, 1]; `mixing`: variance by light of other surfaces. */
static inline float texture_variance_weight(const struct texture_variance *v, float weight, float mixing) {
    return v->texture / (texture_variance_noise(v, weight) + mixing + v->texture);
}

#endif
