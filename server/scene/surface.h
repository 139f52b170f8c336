/* surface.h -- the piece of surface that a texel stands for. */
#ifndef UNBAKE_SCENE_SURFACE_H
#define UNBAKE_SCENE_SURFACE_H

#include <stdbool.h>
#include <stdint.h>

#include "common/vec.h"
#include "server/scene/atlas.h"
#include "server/scene/inverse_uv.h"
#include "server/scene/mesh.h"

struct surface_point {
    uint32_t triangle;
    float b1, b2;  /* barycentrics of the triangle's second and third corner */
    vec3 position; /* metres */
    vec3 normal;   /* unit, geometric: towards the front */
    vec3 shading;  /* unit, interpolated; the geometric one where the mesh has none, or where the
                    * interpolated one leans behind the surface */
};

/* The shading normal at a place of a triangle that has such a geometric normal. */
vec3 surface_shading(const struct mesh *mesh, uint32_t triangle, float b1, float b2, vec3 normal);

/* The point of the surface at the texel's centre; false when the texel is not valid. */
bool surface_at_texel(const struct mesh *mesh, const struct atlas *atlas,
                      const struct inverse_uv *inverse, uint32_t texel, struct surface_point *point);

/* The same for the place (x, y) inside a valid texel, in texels. */
bool surface_at(const struct mesh *mesh, const struct atlas *atlas, const struct inverse_uv *inverse,
                float x, float y, struct surface_point *point);

#endif
