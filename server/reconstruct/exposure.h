/* exposure.h -- the exposures that a capture does not tell.
 *
 * One log-gain a frame, from overlaps: the same surface point should have the same radiance in
 * all frames that see it. Solved by least squares over points and frames in turn, with weights
 * that let outliers (highlights, edges) go. Where no exposure is known the gains' mean is 0. */
#ifndef UNBAKE_RECONSTRUCT_EXPOSURE_H
#define UNBAKE_RECONSTRUCT_EXPOSURE_H

#include "server/reconstruct/views.h"
#include "server/scene/atlas.h"
#include "server/scene/inverse_uv.h"

/* Sets `exposure` of the training frames whose exposure is not known. Returns how many were
 * solved; frames that share no point with others keep 1. */
size_t exposure_solve(struct scene *scene, struct views *views, const struct atlas *atlas,
                      const struct inverse_uv *inverse);

#endif
