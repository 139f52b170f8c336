/* specular_fit.h -- fits roughness and specular of each segment to the view dependence of its texels.
 *
 * At up to 1,024 texels of a segment, each observed by several photographs, the highlight of every candidate material
 * is gathered (highlight.h). The rest must equal base colour times the diffuse lobe's radiance, with one base colour
 * for all observations of a texel. A candidate's likelihood follows from its misfit beyond that of the best one, in
 * standard errors over the texels; segments of similar base colour share evidence (specular_posterior.h). A segment
 * that is diffuse with a high probability becomes diffuse; any other gets the posterior mean, with the roughness of
 * the best candidate refined by a parabola through its neighbours. Emitters are diffuse: their own light hides what
 * they reflect. */
#ifndef UNBAKE_MATERIAL_SPECULAR_FIT_H
#define UNBAKE_MATERIAL_SPECULAR_FIT_H

#include <stdint.h>

#include "common/parallel.h"
#include "server/capture/views.h"
#include "server/gather/probes.h"
#include "server/state/reconstruction.h"

/* Writes r->materials.roughness and .specular. */
void specular_fit(struct reconstruction *r, const struct views *views, const struct probes *probes,
                  const struct light_field *field);

#endif
