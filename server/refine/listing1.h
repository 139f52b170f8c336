/* listing1.h -- the published algorithm (Nimier-David et al. 2021, supplemental, Listing 1), from a
 * neutral start: the baseline that the default method is measured against.
 *
 * An iteration: choose texels evenly over the surface; find the point of each by the inverse UV map; draw cameras that
 * see it; trace paths from each camera through the texel, with derivatives; compare two independent half-estimates with
 * the photograph (all in pass.h); walk the paths backwards; step every touched parameter by Adam (params.h).
 *
 * It starts from grey base colour and from emission that is a part of a segment's observed radiance: near 1 for
 * segments that outshine the room, near 0 for those darker than most. After DECISION_AT of the run each segment is
 * declared an emitter or not (emitter_decision.h); from then on the emission of all others is exactly 0. Base colour is
 * solved coarse to fine: at level L the texels of a block of 2^L x 2^L share one factor, at level 0 each has its
 * own. */
#ifndef UNBAKE_REFINE_LISTING1_H
#define UNBAKE_REFINE_LISTING1_H

#include "server/refine/optimiser.h"

/* Sets the materials to the neutral start, by the radiance that evidence has of each segment. */
struct optimiser *listing1_new(const struct optimiser_input *input);

#endif
