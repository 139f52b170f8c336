/* emission_pattern.h -- textured emission: screens, windows with a view, lamp shades.
 *
 * Observed radiance of an emitter's texels is averaged and denoised as base colour is (denoise.h). Where the result
 * varies by more than MIN_CONTRAST the segment's emission gets a pattern (materials.h); others keep one radiance.
 * Pixels within one of another surface are not used: next to an emitter everything is dark. Emission is assumed
 * diffuse: a distant view through a window becomes the mean of what is observed from different places. */
#ifndef UNBAKE_MATERIAL_EMISSION_PATTERN_H
#define UNBAKE_MATERIAL_EMISSION_PATTERN_H

#include "common/parallel.h"
#include "server/capture/fuse.h"
#include "server/capture/noise.h"
#include "server/capture/views.h"
#include "server/scene/materials.h"
#include "server/scene/surface.h"
#include "server/state/evidence.h"

/* What the search reads. Borrowed. */
struct emission_pattern_input {
    struct surface surface;
    const struct views *views;
    const struct noise *noise; /* of the photographs */
    const struct fused *fused;
    const bool *is_emitter; /* [segment_count] */
    struct parallel *pool;
};

/* Finds the patterns of all emitters in their outgoing radiance, emitted and reflected: writes the emission patterns of
 * *materials and, where there is one, sets evidence[segment_count].radiance to the mean over the surface. Depends only
 * on photographs, emitters and evidence.observed, not on the number of threads. */
void emission_pattern_find(const struct emission_pattern_input *in, struct materials *materials,
                           struct emitter_evidence *evidence);

/* Emitted radiance, mean over the surface, and base colour (all channels). */
struct emitter_fit {
    rgb radiance;
    float base_color;
};

/* Subtracts reflected light (base colour times evidence.lambert) from the patterns just found, and fills
 * own[segment_count], {0, NEUTRAL_BASE_COLOR} where nothing emits. Base colour of an emitter is neutral, or less where
 * the darkest part of its pattern shows less; a hidden emitter reflects nothing. */
void emission_pattern_separate(const struct emission_pattern_input *in, struct materials *materials,
                               const struct emitter_evidence *evidence, struct emitter_fit *own);

/* Recomputes the patterns from stored emitters and evidence: checkpoints do not contain them. */
void emission_pattern_restore(const struct emission_pattern_input *in, struct materials *materials,
                              struct emitter_evidence *evidence);

#endif
