/* emission_pattern.h -- emitters that are not equally bright all over: screens, windows with a view, lamp shades.
 *
 * What the photographs show of an emitter's texels is averaged and freed of noise as base colours are (denoise.h).
 * Where what is left varies by more than a lamp's own unevenness would matter, the segment's emission gets a pattern
 * (materials.h); all others stay of one radiance. Looks within a pixel of another surface are not asked:
 * beside an emitter everything is dark. Emission is thought to be diffuse: what lies far behind a window is the mean of
 * what is seen through it from different places. */
#ifndef UNBAKE_MATERIAL_EMISSION_PATTERN_H
#define UNBAKE_MATERIAL_EMISSION_PATTERN_H

#include "server/capture/views.h"
#include "server/state/reconstruction.h"

/* Finds the patterns of what emits (is_emitter) in all that it sends out, own and reflected light together; where there
 * is one evidence.shown becomes the mean over the surface. The same whenever it is called for the same photographs,
 * emitters and evidence.least, on any number of threads. */
void emission_pattern_find(struct reconstruction *r, const struct views *views);

/* What an emitter sends out of itself, in the mean over its surface, and what it reflects (all channels). */
struct emission_own {
    rgb radiance;
    float base_color;
};

/* Takes the light that they reflect, told by evidence.arrived, out of the patterns that were just found, and fills
 * own[segment_count], {0, NEUTRAL_BASE_COLOR} where nothing emits. An emitter reflects as a neutral base colour does, a
 * hidden one nothing, and no more than the darkest part of a pattern shows. */
void emission_pattern_own(struct reconstruction *r, struct emission_own *own);

/* Makes the patterns what they were when emitters and evidence were stored: a checkpoint does without them. */
void emission_pattern_restore(struct reconstruction *r, const struct views *views);

#endif
