/* atlas.h -- a one-to-one map from the mesh's triangles into a rectangle of texels.
 *
 * Charts are connected, nearly planar sets of triangles of one segment, projected each at one
 * density (texels per metre), the same for all unless told otherwise, and packed with a gap. Atlas coordinates are in texels, x to the
 * right and y down from the image's top left corner; texel (i, j) covers [i, i+1) x [j, j+1).
 * They are whole multiples of 1 / COVERAGE_UNITS (coverage.h), so it is exact which texels are
 * covered. A chart is projected along one direction: a triangle that leans keeps at least
 * cos(CHART_MAX_LEAN_DEG) of its area (atlas_chart.h), and most keep nearly all.
 * In a PLY, s = x / width and t = 1 - y / height (origin lower left). */
#ifndef UNBAKE_SCENE_ATLAS_H
#define UNBAKE_SCENE_ATLAS_H

#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "common/vec.h"
#include "server/scene/mesh.h"
#include "server/scene/segment.h"

#define ATLAS_MAX_SIZE 16384
#define ATLAS_PADDING 2 /* texels free between the covered texels of two charts, at least */

struct atlas {
    uint32_t width, height;      /* texels */
    float texels_per_metre;      /* the greatest density of a chart */
    size_t chart_count;
    uint32_t *chart_of_triangle; /* [triangle_count]; owned */
    vec2 (*corner)[3];           /* [triangle_count] atlas coordinates of the corners, texels; owned */
    double utilisation;          /* covered texels / all texels */
};

/* Makes an atlas of `size` x `size` texels at the greatest density that fits; when
 * texels_per_metre is not 0 that density instead, at the smallest power-of-two size up to
 * ATLAS_MAX_SIZE that holds it (STATUS_INPUT when none does). Deterministic. */
enum status atlas_make(struct atlas *atlas, const struct mesh *mesh, const struct segments *segments,
                       uint32_t size, float texels_per_metre, struct error *err);
/* As with a size, but a chart gets only the greatest of density[triangle_count], in (0, 1], of its triangles as its
 * part of that greatest density. */
enum status atlas_make_uneven(struct atlas *atlas, const struct mesh *mesh, const struct segments *segments,
                              uint32_t size, const float *density, struct error *err);
void atlas_release(struct atlas *atlas);

/* Atlas coordinates of the point with barycentrics (1 - b1 - b2, b1, b2) on a triangle. */
static inline vec2 atlas_point(const struct atlas *atlas, size_t triangle, float b1, float b2) {
    const vec2 *c = atlas->corner[triangle];
    float b0 = 1.0f - b1 - b2;
    return (vec2){b0 * c[0].x + b1 * c[1].x + b2 * c[2].x,
                  b0 * c[0].y + b1 * c[1].y + b2 * c[2].y};
}

#endif
