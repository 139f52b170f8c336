/* refine.h -- what `solve` left, corrected by path tracing where it is smooth.
 *
 * Solve takes light from where one ray meets a surface that photographs show; refine follows whole
 * paths. It looks at texels as listing1 does (pass.h), but walks no path backwards: base colour keeps its detail and
 * moves by smooth factors, as what was shown and what was rendered tell them together (match.h, correction.h); the
 * emitters move by what is seen of them (emission.h); roughness and specular stay.
 *
 * It ends when each part of the texture had the looks that are asked for (setting refine_looks). */
#ifndef UNBAKE_REFINE_REFINE_H
#define UNBAKE_REFINE_REFINE_H

#include "server/refine/optimiser.h"

/* Made before solve has run, since it may find a checkpoint that spares it. Borrows all. */
struct optimiser *refine_new(struct reconstruction *r, const struct views *views,
                             const struct reconstruct_hooks *hooks);

/* Tells that solve has filled r->materials and r->is_emitter; saves a checkpoint. */
enum status refine_start(struct optimiser *o, struct error *err);

#endif
