/* color_prior.h -- prior mean and variance of base colour for each chart.
 *
 * For a segment that photographs show well: mean and variance of its texels. For one that they hardly show, or only in
 * mixed pixels: those of the surfaces around it, since a window's reveal resembles the wall beside it more than the
 * mean of the room. The surroundings of a texel are its cube in the finest of nested grids that has measurements. */
#ifndef UNBAKE_MATERIAL_COLOR_PRIOR_H
#define UNBAKE_MATERIAL_COLOR_PRIOR_H

#include "common/parallel.h"
#include "server/material/denoise.h"
#include "server/scene/surface.h"

/* [chart_count] from measured[height][width]; the caller's. Emitters get NEUTRAL_BASE_COLOR. */
struct color_prior *color_priors(const struct surface *surface, const bool *is_emitter,
                                 const struct measurement *measured, struct parallel *pool);

#endif
