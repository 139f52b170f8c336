/* atlas.h -- a one-to-one map from the mesh's triangles into a rectangle of texels.
 *
 * Charts are connected, nearly planar sets of triangles of one segment. Each is projected to its plane at a density
 * (texels per metre; by default the same for all), and they are packed with a gap. Atlas coordinates are in texels, x
 * to the right and y down from the top left corner; texel (i, j) covers [i, i+1) x [j, j+1). They are multiples of 1
 * / COVERAGE_UNITS (coverage.h), so coverage of texels is exact. Within a chart, a tilted triangle keeps at least
 * cos(CHART_MAX_LEAN_DEG) of its area (atlas_chart.h). In a PLY, s = x / width and t = 1 - y / height (origin lower
 * left). */
#ifndef UNBAKE_SCENE_ATLAS_H
#define UNBAKE_SCENE_ATLAS_H

#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "common/vec.h"
#include "server/scene/mesh.h"
#include "server/scene/segment.h"

#define ATLAS_MAX_SIZE 16384 /* texels a side: coverage.h is exact up to it */
#define ATLAS_PADDING 2      /* minimum number of free texels between the covered texels of two charts */
/* ATLAS_WIDE_PADDING, which keeps mip level 2 clean, or ATLAS_PADDING where the former would cost more than a tenth of
 * the density: of rooms of objects it costs 5 to 8 %, of a scan in 13,000 charts (redkitchen) 28 %. */
#define ATLAS_AUTOMATIC_PADDING 0
#define ATLAS_WIDE_PADDING 7

struct atlas {
    uint32_t width, height; /* texels */
    float texels_per_metre; /* density of the densest chart */
    size_t chart_count;
    uint32_t *chart_of_triangle; /* [triangle_count]; owned */
    vec2 (*corner)[3];           /* [triangle_count] atlas coordinates of the corners, texels; owned */
    double utilisation;          /* covered texels / all texels */
    uint32_t padding;            /* free texels that are kept between charts */
};

/* The highest mip level of which no texel that covers a chart has values of another one, where texels between charts
 * have the value of the nearest chart: a texel of level n is 2^n wide, so its far corner is sqrt(2) (2^n - 1) texels
 * off the chart and must be nearer to it than to the next one. */
static inline int atlas_clean_level(uint32_t padding) {
    int level = 0;
    while ((float)padding + 1.0f > 2.41421356f * (float)((2 << level) - 1))
        level++;
    return level;
}

/* Makes a size x size atlas at the greatest density that fits. If texels_per_metre is not 0, uses that density and
 * the smallest power-of-two size up to ATLAS_MAX_SIZE that holds it (STATUS_INPUT when none does). `padding`: free
 * texels between charts. Deterministic. */
enum status atlas_make(struct atlas *atlas, const struct mesh *mesh, const struct segments *segments, uint32_t size,
                       float texels_per_metre, uint32_t padding, struct error *err);
/* As atlas_make with a size. The density of a chart is the maximum of density[triangle_count], each in (0, 1], over
 * its triangles, as a fraction of the greatest density. */
enum status atlas_make_uneven(struct atlas *atlas, const struct mesh *mesh, const struct segments *segments,
                              uint32_t size, const float *density, uint32_t padding, struct error *err);
void atlas_release(struct atlas *atlas);

/* Atlas coordinates of the point with barycentrics (1 - b1 - b2, b1, b2) on a triangle. */
static inline vec2 atlas_point(const struct atlas *atlas, size_t triangle, float b1, float b2) {
    const vec2 *c = atlas->corner[triangle];
    float b0 = 1.0f - b1 - b2;
    return (vec2){b0 * c[0].x + b1 * c[1].x + b2 * c[2].x, b0 * c[0].y + b1 * c[1].y + b2 * c[2].y};
}

#endif
