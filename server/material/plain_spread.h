/* plain_spread.h -- how far base colour that should be equal varies from place to place along a surface.
 *
 * Noise of the photographs, draws of the gathered light and light that is a little wrong all make a plain wall darker
 * here and brighter there. How much is read off the room itself: of cells of each chart, the logarithm of base colour
 * less the chart's median. The median over all cells of the absolute value, as a standard deviation (Hampel 1974), is
 * what most surface has: texture adds to it where it is coarser than a cell, on less than half of the surface it is an
 * outlier. Where more of a room is textured on that scale, the spread is that of texture, and too large.
 *
 * It does not contain what a whole chart has wrong, nor the whole room. */
#ifndef UNBAKE_MATERIAL_PLAIN_SPREAD_H
#define UNBAKE_MATERIAL_PLAIN_SPREAD_H

#include <stdbool.h>

#include "server/scene/surface.h"
#include "server/scene/texture.h"

#define PLAIN_SPREAD_CELLS 32 /* fewer do not tell a median */
/* The relative standard deviation, from the observed texels (observed[height][width] above 0: photographs that show it)
 * of segments that do not emit (is_emitter[segment_count]). NaN where fewer than PLAIN_SPREAD_CELLS cells tell it. */
float plain_spread(const struct surface *surface, const struct texture *base_color, const float *observed,
                   const bool *is_emitter);

#endif
