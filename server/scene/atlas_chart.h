/* atlas_chart.h -- cutting a mesh into charts: pieces that lie flat without overlap.
 *
 * A chart is a set of triangles of one segment, connected over shared edges, and its projection
 * along one direction. It covers no place of its plane twice, and no triangle leans away from
 * the plane by more than CHART_MAX_LEAN_DEG: so a triangle keeps its area times a factor
 * between cos(CHART_MAX_LEAN_DEG) and 1, and lengths never grow. */
#ifndef UNBAKE_SCENE_ATLAS_CHART_H
#define UNBAKE_SCENE_ATLAS_CHART_H

#include <stddef.h>
#include <stdint.h>

#include "server/scene/mesh.h"
#include "server/scene/segment.h"

#define CHART_MAX_LEAN_DEG 75.0

struct charts {
    size_t count;
    uint32_t *of_triangle; /* [triangle_count]; owned */
    size_t *start;         /* [count + 1] into `triangle`; owned */
    uint32_t *triangle;    /* [triangle_count] grouped by chart, ascending within one; owned */
    vec2 (*corner)[3];     /* [triangle_count] metres in the chart's plane, turned so that the
                            * rectangle around the chart is the smallest, its lower corner at
                            * (0, 0); owned */
    vec2 *extent;          /* [count] metres, of that rectangle; owned */
    double flat_area;      /* of all projections, m^2 */
};

/* texel_m is the approximate size of a texel: charts of a few texels may lean more, since a seam costs them more than
 * the distortion. Deterministic. */
void charts_make(struct charts *charts, const struct mesh *mesh, const struct segments *segments, float texel_m);
void charts_release(struct charts *charts);

#endif
