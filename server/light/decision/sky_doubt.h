/* sky_doubt.h -- the light of unobserved sky on a segment.
 *
 * A window sill lies under the sky up to the zenith; photographs taken in the room look out a little above the horizon,
 * and what is above that was filled in from there (environment.h). Skies get brighter upwards, or towards the sun, by
 * factors. A sill that is brighter than white paint under the filled-in sky is no lamp as long as such a sky would
 * explain it. The light of unobserved sky is found here; what emits is decided by its variance in
 * reflection.c. The map is not changed. */
#ifndef UNBAKE_LIGHT_DECISION_SKY_DOUBT_H
#define UNBAKE_LIGHT_DECISION_SKY_DOUBT_H

#include <stddef.h>
#include <stdint.h>

#include "server/state/reconstruction.h"

/* Lambert radiance at albedo 1 (mean of the channels), at the brighter of texel[count], all of one segment, by the
 * unobserved directions of the map of r->world's environment; 0 without a map. Thread-safe. */
float sky_doubt(const struct reconstruction *r, const uint32_t *texel, size_t count);

#endif
