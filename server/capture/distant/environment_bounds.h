/* environment_bounds.h -- what photographs of short exposures tell of directions that others alone show, saturated.
 *
 * Radiance beyond a bound is told by directions that were measured although they might have been brighter than that:
 * those of which a photograph saturates at a greater radiance only. Where what they show, continued (fill.h), exceeds
 * the bound, the bound tells nothing, and the direction counts as unseen. Elsewhere, as beside the edge of a house, it
 * is as bright as the median of those of its half that exceed the bound. Where nothing tells of it, as with a single
 * exposure or in a sun, it stays a bound. */
#ifndef UNBAKE_CAPTURE_DISTANT_ENVIRONMENT_BOUNDS_H
#define UNBAKE_CAPTURE_DISTANT_ENVIRONMENT_BOUNDS_H

#include <stdint.h>

#include "server/capture/distant/environment.h"

/* What a map is gathered with, of each direction: [height][width]. */
struct environment_ceiling {
    float *radiance;         /* up to which a photograph could have measured it */
    uint8_t *bound_channels; /* a bit for each channel of which the map has a lower bound only */
};

/* Changes map, confidence and is_bound of *e, which is not filled in yet. */
void environment_tell_bounds(struct environment *e, const struct environment_ceiling *ceiling);

#endif
