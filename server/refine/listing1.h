/* listing1.h -- the published algorithm (Nimier-David et al. 2021, supplemental, Listing 1), from a
 * neutral start: the baseline that the default method is measured against.
 *
 * An iteration: choose texels evenly over the surface; find the point of each by the inverse UV
 * map; draw a batch of cameras that see it; connect paths from each camera through the texel and
 * look up the photograph there; trace with derivatives; compare two independent half-estimates
 * with the photograph (all of that: pass.h); walk the paths backwards; move every parameter that
 * was touched by Adam (params.h).
 *
 * The start is grey base colour, and of the light that is seen of a segment a part its own that is
 * near 1 for what outshines the room and near 0 for what is darker than most. After a first part of
 * the run each segment is declared an emitter or not (emitters.h); from then on the emission of all
 * others is exactly 0. Base colour is solved coarse to fine: at level L all texels of a block of
 * 2^L x 2^L move by a common factor, at level 0 each by itself. */
#ifndef UNBAKE_REFINE_LISTING1_H
#define UNBAKE_REFINE_LISTING1_H

#include "server/refine/optimiser.h"

/* Gives r->materials and r->evidence the neutral start; works on them, r->world and r->is_emitter.
 * Borrows all. */
struct optimiser *listing1_new(struct reconstruction *r, const struct views *views,
                               const struct reconstruct_hooks *hooks);

#endif
