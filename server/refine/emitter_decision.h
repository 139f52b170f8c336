/* emitter_decision.h -- decides which segments emit, once in the course of listing1.
 *
 * Until then every observed segment emits a part of its observed radiance, larger the brighter it is, and base colour
 * makes up the rest. Outgoing radiance of all surfaces is then about right, and so is incident light, which bounds what
 * a segment could reflect with base colour 1. A segment that is clearly brighter is an emitter (the residual of FIPT,
 * Wu et al. 2023, by segment). */
#ifndef UNBAKE_REFINE_EMITTER_DECISION_H
#define UNBAKE_REFINE_EMITTER_DECISION_H

#include "server/refine/observation.h"
#include "server/state/evidence.h"
#include "server/state/reconstruction.h"

/* Fills `lambert` and `emitted_share` of evidence[segment_count] by observations with the present materials, decides,
 * and sets the emission of every emitter in r->materials: its radiance less the reflection of a neutral base colour.
 * batch[threads] is scratch for EMITTER_DECISION_TEXELS texels. */
#define EMITTER_DECISION_TEXELS 32 /* texels observed of a segment, at most */
void emitter_decision_make(struct reconstruction *r, struct observation_batch *batch,
                           struct emitter_evidence *evidence);

#endif
