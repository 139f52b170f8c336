/* surface.h -- the parametrised surface of a scene, and the surface point of a texel. */
#ifndef UNBAKE_SCENE_SURFACE_H
#define UNBAKE_SCENE_SURFACE_H

#include <stdbool.h>
#include <stdint.h>

#include "common/vec.h"
#include "server/scene/atlas.h"
#include "server/scene/inverse_uv.h"
#include "server/scene/mesh.h"
#include "server/scene/segment.h"

/* The mesh, its segments, and the map from its triangles to texels and back. All borrowed. */
struct surface {
    const struct mesh *mesh;
    const struct segments *segments;
    const struct atlas *atlas;
    const struct inverse_uv *inverse;
};

/* The chart and the segment of a valid texel. */
static inline uint32_t surface_chart(const struct surface *s, uint32_t texel) {
    return s->atlas->chart_of_triangle[s->inverse->triangle[texel]];
}
static inline uint32_t surface_segment(const struct surface *s, uint32_t texel) {
    return s->segments->of_triangle[s->inverse->triangle[texel]];
}

struct surface_point {
    uint32_t triangle;
    float b1, b2;  /* barycentrics of the triangle's second and third corner */
    vec3 position; /* metres */
    vec3 normal;   /* unit, geometric: towards the front */
    vec3 shading;  /* unit, interpolated; the geometric one where the mesh has none, or where the
                    * interpolated one leans behind the surface */
};

/* Interpolated shading normal at a point of a triangle with geometric normal `normal`. */
vec3 surface_shading(const struct mesh *mesh, uint32_t triangle, float b1, float b2, vec3 normal);

/* Surface point at the texel's centre; false when the texel is not valid. */
bool surface_at_texel(const struct mesh *mesh, const struct atlas *atlas, const struct inverse_uv *inverse,
                      uint32_t texel, struct surface_point *point);

/* Square metres that a texel of a triangle covers; 0 where the triangle has no area in the atlas. */
float surface_texel_m2(const struct mesh *mesh, const struct atlas *atlas, uint32_t triangle);

/* Surface point at (x, y), in texels, inside a valid texel. */
bool surface_at(const struct mesh *mesh, const struct atlas *atlas, const struct inverse_uv *inverse, float x, float y,
                struct surface_point *point);

#endif
