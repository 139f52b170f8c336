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
 * After `solve` (method=solve) it starts from what that found instead, and corrects only what is
 * smooth in it: blocks of 2^coarse_levels texels a side keep their detail and move by the ratio of
 * what was shown to what was rendered with all bounces (params_match), against a prior for what was
 * solved; the emitters move as above; roughness and specular stay. */
#ifndef UNBAKE_RECONSTRUCT_LISTING1_H
#define UNBAKE_RECONSTRUCT_LISTING1_H

#include <stdbool.h>

#include "server/reconstruct/reconstruct.h"
#include "server/reconstruct/views.h"

struct refine; /* opaque */

/* Works on r->materials, r->world, r->is_emitter and r->evidence; without method=solve they get the
 * neutral start here. Borrows all. */
struct refine *listing1_new(struct reconstruction *r, const struct views *views,
                            const struct reconstruct_hooks *hooks);
void listing1_free(struct refine *f);

/* Takes up the newest checkpoint where there is one. */
enum status listing1_load(struct refine *f, bool *found, struct error *err);

/* Tells that `solve` has filled the materials, in so many seconds of the time limit; saves a checkpoint. */
enum status listing1_start_solved(struct refine *f, double seconds, struct error *err);

/* Iterates to the end. Adds "refine" and the loss curve to r->report. STATUS_CANCELLED when
 * stopped (a checkpoint was saved). */
enum status listing1_run(struct refine *f, struct error *err);

#endif
