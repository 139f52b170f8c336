/* denoise.h -- removes the photographs' noise from base colour, and fills in texels that were not measured.
 *
 * Each chart is filtered scale by scale (wiener.h), from one texel up to the whole chart. The power of noise is
 * known from a sample of it: half of a texel's photographs less the other half (split_half.h), which preserves the
 * correlation of noise between neighbouring texels. Where there is a single photograph, the sample is read from a
 * picture of pure noise (noise.h). Detail is kept by its share of texture: walls become flat, wood keeps its grain.
 * A texel's weight is its inverse noise variance, but in means no greater than texture allows (texture_variance.h);
 * texels of weight 0 are filled in from their neighbours, and charts without measurements from their prior. Nothing
 * crosses the border of a chart, hence none of a segment. */
#ifndef UNBAKE_MATERIAL_DENOISE_H
#define UNBAKE_MATERIAL_DENOISE_H

#include <stdbool.h>
#include <stdint.h>

#include "common/parallel.h"
#include "common/vec.h"
#include "server/material/measurement.h"
#include "server/scene/atlas.h"
#include "server/scene/inverse_uv.h"
#include "server/scene/texture.h"

/* Prior of a chart's base colour. */
struct color_prior {
    rgb mean;
    float variance; /* of texels about the mean, summed over the channels */
};

/* Writes the valid texels of `out` from measured[height][width] and prior[chart_count]: those of the charts for which
 * wanted[chart_count] is true, or of all where it is NULL. deviation[height][width], NULL or half precision: their
 * expected error, a standard deviation over the channels, by noise, by detail that is lost with it, by light of other
 * surfaces, and by edges, of which one texel in stride x stride was measured; of texels that were not measured that of
 * the prior. The same for any number of threads. */
void denoise(const struct atlas *atlas, const struct inverse_uv *inverse, size_t triangle_count,
             const struct measurement *measured, const struct color_prior *prior, const bool *wanted,
             struct texture *out, uint32_t stride, uint16_t *deviation, struct parallel *pool);

#endif
