/* bright_texels.h -- where a segment is looked at for whether it emits.
 *
 * A segment may be a lamp in part: a shade and its frame, a pane and its bars. What its bright texels show is what the
 * decision is about. */
#ifndef UNBAKE_LIGHT_DECISION_BRIGHT_TEXELS_H
#define UNBAKE_LIGHT_DECISION_BRIGHT_TEXELS_H

#include <stddef.h>
#include <stdint.h>

#include "server/state/reconstruction.h"

/* Fills chosen[] with texels of texel[count], all of one segment: evenly spaced ones of those that are about as bright
 * as the segment, or of all where none is. Returns how many, at most `wanted`. Thread-safe. */
size_t bright_texels_choose(const struct reconstruction *r, const uint32_t *texel, size_t count, size_t wanted,
                            uint32_t *chosen);

#endif
