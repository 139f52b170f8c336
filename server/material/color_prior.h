/* color_prior.h -- what base colour is to be expected of each chart before its texels are looked at.
 *
 * Of a segment that photographs show well: its mean and how its texels vary about it. Of one that they
 * hardly show, or only in pixels that mix surfaces: what is measured of the surfaces around it, since a
 * window's reveal is more like the wall beside it than like the mean of the room. Surroundings are
 * the finest of nested grids of cubes in which something was measured. */
#ifndef UNBAKE_MATERIAL_COLOR_PRIOR_H
#define UNBAKE_MATERIAL_COLOR_PRIOR_H

#include "server/material/denoise.h"
#include "server/state/reconstruction.h"

/* [chart_count] from measured[height][width]; the caller's. Emitters' are neutral. */
struct color_prior *color_priors(const struct reconstruction *r, const struct measured *measured);

#endif
