/* denoise.h -- base colour without the photographs' noise, and in-fill where nothing was measured.
 *
 * Each chart is filtered scale by scale (wiener.h), from one texel up to the whole chart: a wall that differs over a
 * metre by no more than noise does is flat. What noise alone gives is known by a draw of it: half of the photographs
 * of a texel held against the others (halves.h), so that what they do not agree on is noise, and what correlates that
 * of neighbouring texels is accounted for. Where one photograph alone tells, the same look-up is made in a picture of
 * pure noise (noise.h). Detail is kept by its share of texture: walls become flat, wood keeps its grain.
 * The weight of a texel tells how noisy it is beside its neighbours; one of weight 0 is filled in
 * from them, and a chart of which nothing is known from its prior. Nothing crosses the border of a
 * chart, so nothing crosses that of a segment. */
#ifndef UNBAKE_MATERIAL_DENOISE_H
#define UNBAKE_MATERIAL_DENOISE_H

#include <stdbool.h>
#include <stdint.h>

#include "common/parallel.h"
#include "common/vec.h"
#include "server/material/measured.h"
#include "server/scene/atlas.h"
#include "server/scene/inverse_uv.h"
#include "server/scene/texture.h"

/* What is known of a chart's colour before its texels are looked at. */
struct color_prior {
    rgb mean;
    float variance; /* of texels about the mean, summed over the channels */
};

/* Writes the valid texels of `out` from measured[height][width] and prior[chart_count]: those of the charts for which
 * wanted[chart_count] is true, or of all where it is NULL. The same for any number of threads. */
void denoise(const struct atlas *atlas, const struct inverse_uv *inverse, size_t triangle_count,
             const struct measured *measured, const struct color_prior *prior, const bool *wanted,
             struct texture *out, struct parallel *pool);

#endif
