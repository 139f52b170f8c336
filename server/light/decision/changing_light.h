/* changing_light.h -- surfaces whose own light changed between photographs: screens.
 *
 * A still surface reflects the same in all photographs but for its highlight. One that is black in some of them and in
 * others about as bright as white paint there, over much of it and brighter than any highlight would be, shines itself,
 * and its picture changed. It need not outshine white paint for that, as what emits must by its residual alone.
 *
 * Limits. A black table on which white paper lies in some photographs, over much of it, does the same. */
#ifndef UNBAKE_LIGHT_DECISION_CHANGING_LIGHT_H
#define UNBAKE_LIGHT_DECISION_CHANGING_LIGHT_H

#include "server/material/divide.h"

/* The share of texel[count], all of one segment, that changed so, by some of them that several photographs see;
 * `thread` picks of d->scratch. Exposures, noise and what photographs show together (fused) are to be known; what emits
 * is decided elsewhere. */
float changing_light(const struct divide *d, const uint32_t *texel, size_t count, int thread);

#endif
