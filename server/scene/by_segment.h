/* by_segment.h -- valid texels, and triangles, grouped by segment. */
#ifndef UNBAKE_SCENE_BY_SEGMENT_H
#define UNBAKE_SCENE_BY_SEGMENT_H

#include <stddef.h>
#include <stdint.h>

#include "common/spaced.h"
#include "server/scene/inverse_uv.h"
#include "server/scene/segment.h"

/* Texels [first[s], first[s + 1]) are those of segment s, in the order of inverse->valid. */
struct texels_by_segment {
    uint32_t *first; /* [segment_count + 1]; owned */
    uint32_t *texel; /* [valid_count]; owned */
};

/* The same of triangles, in the mesh's order. */
struct triangles_by_segment {
    uint32_t *first;    /* [segment_count + 1]; owned */
    uint32_t *triangle; /* [triangle_count]; owned */
};
void by_segment_sort_triangles(struct triangles_by_segment *t, const struct segments *segments, size_t triangle_count);
void by_segment_release_triangles(struct triangles_by_segment *t);

void by_segment_sort(struct texels_by_segment *t, const struct segments *segments, const struct inverse_uv *inverse);
void by_segment_release(struct texels_by_segment *t);

static inline size_t by_segment_count(const struct texels_by_segment *t, size_t segment) {
    return t->first[segment + 1] - t->first[segment];
}

/* The i-th of `wanted` evenly spaced texels of a segment; 1 <= wanted <= by_segment_count. */
static inline uint32_t by_segment_spaced(const struct texels_by_segment *t, size_t segment, size_t i, size_t wanted) {
    return t->texel[t->first[segment] + spaced(i, by_segment_count(t, segment), wanted)];
}

#endif
