/* gloss.h -- roughness and specular of each segment, from how its texels change with the view.
 *
 * At up to a thousand texels of a segment, each seen by several photographs, the highlight of every
 * candidate material is gathered (highlight.h); what remains must be base colour times what the
 * diffuse lobe sends, with one base colour for all views of a texel. How much worse than the best one a
 * candidate does, in standard errors over the texels, is how likely it is by that segment's photographs; segments of
 * about the same base colour are taken into account (gloss_belief.h). A segment that is likely to be matt is matt; any
 * other is as the mean of all candidates by their probability, the best of them placed between its neighbours by a
 * parabola. Emitters are matt: their own light hides what they reflect. */
#ifndef UNBAKE_MATERIAL_GLOSS_H
#define UNBAKE_MATERIAL_GLOSS_H

#include <stdint.h>

#include "common/parallel.h"
#include "server/capture/views.h"
#include "server/gather/probes.h"
#include "server/state/reconstruction.h"

/* Writes r->materials.roughness and .specular. */
void gloss_fit(struct reconstruction *r, const struct views *views, const struct probes *probes,
               const struct light_field *field);

#endif
