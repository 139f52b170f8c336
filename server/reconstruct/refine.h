/* refine.h -- what `solve` left, corrected by path tracing where it is smooth.
 *
 * Solve takes light from where one ray meets a surface that photographs show; refine follows whole
 * paths. It looks at texels as listing1 does (pass.h), but walks no path backwards: of base colour,
 * windows of a 64th of the texture's side keep their detail and move by the ratio of what was shown
 * to what was rendered, against a prior for what was solved (match.h); the emitters move by what is
 * seen of them (emission.h); roughness and specular stay.
 *
 * It ends before its time when windows had enough looks (setting refine_looks): from then on what moves them is
 * hardly what solve left but the faults of renders and photographs themselves, and base colour stays or gets worse. */
#ifndef UNBAKE_RECONSTRUCT_REFINE_H
#define UNBAKE_RECONSTRUCT_REFINE_H

#include "server/reconstruct/optimiser.h"

/* Made before solve has run, since it may find a checkpoint that spares it. Borrows all. */
struct optimiser *refine_new(struct reconstruction *r, const struct views *views,
                             const struct reconstruct_hooks *hooks);

/* Tells that solve has filled r->materials and r->is_emitter, in so many seconds of the time limit;
 * saves a checkpoint. */
enum status refine_start(struct optimiser *o, double seconds, struct error *err);

#endif
