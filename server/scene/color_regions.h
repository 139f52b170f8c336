/* color_regions.h -- regions of a segment's triangles that show about the same.
 *
 * 1. Triangles are joined by what they show (regions.h). Of the regions those are cores that have some area away from
 *    their borders. Bands of triangles that show two things at once, patterns and noise have none: they are taken
 *    apart.
 * 2. Their triangles join the core that is reached over the lightest links, as a watershed. */
#ifndef UNBAKE_SCENE_COLOR_REGIONS_H
#define UNBAKE_SCENE_COLOR_REGIONS_H

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "server/scene/adjacency.h"
#include "server/scene/regions.h"

/* Triangles from a border: nearer ones show both sides; farther ones are not asked. */
#define COLOR_NEAR_RINGS 3
#define COLOR_FAR_RINGS 7

struct color_regions {
    const struct mesh *mesh; /* borrowed, as the next two */
    const struct adjacency *adjacency;
    const uint32_t *of_triangle; /* [triangle_count] segments */
    rgb *value;                  /* [triangle_count] logarithms; NAN: not known; owned, as the next two */
    struct regions regions;
    struct region_link *link; /* [link_count] within segments, the lightest first */
    size_t link_count;
};

static inline bool color_is_known(const struct color_regions *s, uint32_t t) { return !isnan(s->value[t].r); }

static inline float color_distance(rgb a, rgb b) {
    return fmaxf(fabsf(a.r - b.r), fmaxf(fabsf(a.g - b.g), fabsf(a.b - b.b)));
}

/* From values, of which it takes possession: all triangles in regions of at least least_area (m^2), or in what of a
 * segment hangs together. */
void color_regions_find(struct color_regions *s, const struct mesh *mesh, const struct adjacency *adjacency,
                        const uint32_t *of_triangle, rgb *value, double least_area);
void color_regions_release(struct color_regions *s);

/* The root of each triangle; [triangle_count], the caller's. */
uint32_t *color_roots(struct color_regions *s);

/* region[triangle_count]: equal within a region. ring[triangle_count]: how many triangles it is from the border of its
 * region with another of its segment, up to COLOR_FAR_RINGS; 0: farther. beyond[triangle_count]: where ring is not 0,
 * the region beyond the nearest border. */
void color_rings(const struct color_regions *s, const uint32_t *region, uint8_t *ring, uint32_t *beyond);

#endif
