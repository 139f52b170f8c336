/* by_segment.h -- the valid texels of each segment, side by side. */
#ifndef UNBAKE_RECONSTRUCT_BY_SEGMENT_H
#define UNBAKE_RECONSTRUCT_BY_SEGMENT_H

#include <stddef.h>
#include <stdint.h>

#include "server/scene/inverse_uv.h"
#include "server/scene/segment.h"

/* Texels [first[s], first[s + 1]) are those of segment s, in the order of inverse->valid. */
struct texels_by_segment {
    uint32_t *first; /* [segment_count + 1]; owned */
    uint32_t *texel; /* [valid_count]; owned */
};

void by_segment_sort(struct texels_by_segment *t, const struct segments *segments,
                     const struct inverse_uv *inverse);
void by_segment_release(struct texels_by_segment *t);

#endif
