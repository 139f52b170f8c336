/* emission_pattern.h -- textured emission: screens, windows with a view, lamp shades.
 *
 * Observed radiance of an emitter's texels is averaged and denoised as base colour is (denoise.h). Where the result
 * varies by more than MIN_CONTRAST the segment's emission gets a pattern (materials.h); others keep one radiance.
 * Pixels within one of another surface are not used: next to an emitter everything is dark. Emission is assumed
 * diffuse: a distant view through a window becomes the mean of what is observed from different places. */
#ifndef UNBAKE_MATERIAL_EMISSION_PATTERN_H
#define UNBAKE_MATERIAL_EMISSION_PATTERN_H

#include "server/capture/views.h"
#include "server/state/reconstruction.h"

/* Finds the patterns of all emitters (is_emitter) in their outgoing radiance, emitted and reflected; where there is
 * one, sets evidence.radiance to the mean over the surface. Depends only on photographs, emitters and evidence.observed, not
 * on the number of threads. */
void emission_pattern_find(struct reconstruction *r, const struct views *views);

/* Emitted radiance, mean over the surface, and base colour (all channels). */
struct emitter_fit {
    rgb radiance;
    float base_color;
};

/* Subtracts reflected light (base colour times evidence.lambert) from the patterns just found, and fills
 * own[segment_count], {0, NEUTRAL_BASE_COLOR} where nothing emits. Base colour of an emitter is neutral, or less where
 * the darkest part of its pattern shows less; a hidden emitter reflects nothing. */
void emission_pattern_separate(struct reconstruction *r, struct emitter_fit *own);

/* Recomputes the patterns from stored emitters and evidence: checkpoints do not contain them. */
void emission_pattern_restore(struct reconstruction *r, const struct views *views);

#endif
