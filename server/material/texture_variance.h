/* texture_variance.h -- how much the base colour of a chart's texels varies beyond their noise.
 *
 * Texels with more weight are less noisy, but no better examples of what is around them. Where texture varies by T
 * and a texel's noise by s, it counts in means over its surroundings with 1 / (s + T), not with 1 / s: with that a
 * few texels of a patch of sun, a hundred times less noisy than the floor around, would colour it all. As between
 * studies of one effect (random effects; Paule and Mandel 1982). */
#ifndef UNBAKE_MATERIAL_TEXTURE_VARIANCE_H
#define UNBAKE_MATERIAL_TEXTURE_VARIANCE_H

#include "server/material/measurement.h"
#include "server/scene/atlas.h"
#include "server/scene/inverse_uv.h"

/* Of a chart, variances summed over the channels. */
struct texture_variance {
    float texture;
    float noise; /* a texel's by its weight: that of one with weight 1 */
};

/* [atlas->chart_count]; the caller's. */
struct texture_variance *texture_variances(const struct atlas *atlas, const struct inverse_uv *inverse,
                                           const struct measurement *measured);

/* The weight of a texel in means over its surroundings, in the units of its own. */
static inline float texture_variance_weight(const struct texture_variance *v, float weight) {
    return v->noise > 0.0f ? weight / (1.0f + weight * v->texture / v->noise) : weight;
}

#endif
