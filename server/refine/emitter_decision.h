/* emitter_decision.h -- which segments emit, decided once in the course of listing1.
 *
 * Until the decision every segment that photographs show emits a part of what they show of it (the larger the brighter
 * it is) and base colour makes up the rest, so that each surface sends out about the light that the photographs
 * measured, whatever part of it is its own. The light that arrives at a segment is then right too, and tells what the
 * segment could reflect: base colour 1 at most. A segment whose photographs show clearly more than that is an emitter
 * (the residual of FIPT, Wu et al. 2023, taken by segment). */
#ifndef UNBAKE_REFINE_EMITTER_DECISION_H
#define UNBAKE_REFINE_EMITTER_DECISION_H

#include "server/refine/look.h"
#include "server/state/evidence.h"
#include "server/state/reconstruction.h"

/* Fills `arrived` and `share` of evidence[segment_count] by looks at the present state of the materials, decides, and
 * gives every emitter in r->materials its radiance: what is shown less what a neutral base colour would reflect.
 * batch[threads] is scratch for EMITTER_DECISION_TEXELS texels. */
#define EMITTER_DECISION_TEXELS 32
void emitter_decision_make(struct reconstruction *r, struct look_batch *batch, struct emitter_evidence *evidence);

#endif
