/* lambert_mean.h -- what a white surface would send in place of a segment, for the decision whether it emits.
 *
 * Mean over the texels that are about as bright as the segment, where there are any: next to a window light falls off
 * steeply, and a dim end must not be compared with a bright one. */
#ifndef UNBAKE_LIGHT_DECISION_LAMBERT_MEAN_H
#define UNBAKE_LIGHT_DECISION_LAMBERT_MEAN_H

#include <stdbool.h>

#include "server/state/evidence.h"

/* Sums over a segment's texels, all and bright ones: red, green, blue, texels. Starts as 0. */
struct lambert_mean {
    double all[4], bright[4];
};

/* Adds a texel of Lambert radiance `lambert` that shows `observed`. */
void lambert_mean_add(struct lambert_mean *m, const struct emitter_evidence *evidence, rgb observed, rgb lambert);

/* False where there was no texel. */
bool lambert_mean_of(const struct lambert_mean *m, rgb *mean);

#endif
