/* specular_fit.h -- fits roughness and specular of each segment to the view dependence of its texels.
 *
 * At up to 1,024 texels of a segment, each observed by several photographs, the highlight of every candidate material
 * is gathered (highlight.h). The rest must equal base colour times the diffuse lobe's radiance, with one base colour
 * for all observations of a texel. A candidate's likelihood follows from its misfit beyond that of the best one, in
 * standard errors that allow for errors of photographs and of regions (specular_misfit.h); segments of similar base
 * colour share evidence (specular_posterior.h). A segment that is diffuse with a high probability becomes diffuse; any
 * other gets the posterior mean, with the roughness of the best candidate refined by a parabola through its neighbours.
 * Emitters are diffuse: their own light hides what they reflect. */
#ifndef UNBAKE_MATERIAL_SPECULAR_FIT_H
#define UNBAKE_MATERIAL_SPECULAR_FIT_H

#include <stdbool.h>

#include "common/parallel.h"
#include "server/material/specular_observation.h"
#include "server/scene/materials.h"

/* Reads materials->base_color; writes roughness and specular of the segments, which are diffuse where is_emitter. */
void specular_fit(const struct specular_input *input, const bool *is_emitter, struct materials *materials,
                  struct parallel *pool);

#endif
