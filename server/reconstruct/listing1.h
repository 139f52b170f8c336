/* listing1.h -- the published algorithm (Nimier-David et al. 2021, supplemental, Listing 1).
 *
 * An iteration: choose texels evenly over the surface; find the point of each by the inverse UV
 * map; draw a batch of cameras that see it; connect paths from each camera through the texel and
 * look up the photograph there; trace with derivatives; compare two independent half-estimates
 * with the photograph; walk the paths backwards; move every parameter that was touched by Adam.
 *
 * From a neutral start: grey base colour, and of the light that is seen of a segment a part its own
 * that is near 1 for what outshines the room and near 0 for what is darker than most. After a first part of the run each segment is declared an emitter or not (emitters.h);
 * from then on the emission of all others is exactly 0. Base colour is solved coarse to fine: at
 * level L all texels of a block of 2^L x 2^L move by a common factor, at level 0 each by itself.
 *
 * With guided=false that is all. With guided=true (the default) blocks start with the detail that
 * the photographs show (observe.h) and keep it, base colour moves by the ratio of what was shown
 * to what was rendered (params_match) and not by its noisier gradient, and the finest level is
 * blocks of 4 x 4: more base colour for the same paths, by far. Roughness, specular and emission
 * move by Adam on the derivatives in both. */
#ifndef UNBAKE_RECONSTRUCT_LISTING1_H
#define UNBAKE_RECONSTRUCT_LISTING1_H

#include "server/reconstruct/reconstruct.h"
#include "server/reconstruct/views.h"

/* Works on r->materials, r->world and r->is_emitter, from a checkpoint where there is one. Adds
 * "refine" and the loss curve to r->report. STATUS_CANCELLED when stopped. */
enum status listing1_run(struct reconstruction *r, const struct views *views,
                         const struct reconstruct_hooks *hooks, struct error *err);

#endif
