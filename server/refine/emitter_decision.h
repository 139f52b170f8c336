/* emitter_decision.h -- decides which segments emit, once in the course of listing1.
 *
 * Until then every observed segment emits a part of its observed radiance, larger the brighter it is, and base colour
 * makes up the rest. Outgoing radiance of all surfaces is then about right, and so is incident light, which bounds what
 * a segment could reflect with base colour 1. A segment that is clearly brighter is an emitter (the residual of FIPT,
 * Wu et al. 2023, by segment). */
#ifndef UNBAKE_REFINE_EMITTER_DECISION_H
#define UNBAKE_REFINE_EMITTER_DECISION_H

#include "common/parallel.h"
#include "common/settings.h"
#include "server/refine/observation.h"
#include "server/scene/materials.h"
#include "server/scene/surface.h"
#include "server/state/evidence.h"

#define EMITTER_DECISION_TEXELS 32 /* texels observed of a segment, at most */

/* What the decision reads, and batch[threads], scratch for EMITTER_DECISION_TEXELS texels each. Borrowed. */
struct emitter_decision_input {
    struct surface surface;
    const struct settings *settings; /* the user may have decided for some segments */
    struct observation_batch *batch;
    struct parallel *pool;
};

/* Fills `lambert` and `emitted_share` of evidence[segment_count] by observations with the present materials; decides
 * is_emitter[segment_count]; sets the emission in *materials: for emitters their radiance less the reflection of a
 * neutral base colour, else 0. */
void emitter_decision_make(const struct emitter_decision_input *in, struct emitter_evidence *evidence, bool *is_emitter,
                           struct materials *materials);

#endif
