/* refine.h -- corrects smooth errors of `solve` by path tracing.
 *
 * Solve follows one ray from each point to an observed surface; refine traces whole paths. It makes observations as
 * listing1 does (pass.h), but without a backward pass: base colour keeps its detail and is multiplied by smooth
 * factors, from the ratio of observed to rendered radiance (comparison.h, correction.h); emitters are optimised by
 * their directly observed radiance (emission.h); roughness and specular stay.
 *
 * It ends at the number of observations that the setting refine_looks asks for. */
#ifndef UNBAKE_REFINE_REFINE_H
#define UNBAKE_REFINE_REFINE_H

#include "server/capture/fuse.h"
#include "server/capture/noise.h"
#include "server/refine/optimiser.h"

/* Made before solve runs, which a checkpoint may make unnecessary. `fused`: observed radiance, `noise`: of the
 * photographs; both borrowed. */
struct optimiser *refine_new(const struct optimiser_input *input, const struct fused *fused, const struct noise *noise);

/* To be called after solve has filled materials and is_emitter; saves a checkpoint. */
enum status refine_start(struct optimiser *o, struct error *err);

#endif
