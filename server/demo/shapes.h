/* shapes.h -- builds meshes from boxes and surfaces of revolution.
 *
 * Box faces have their own vertices with face normals; surfaces of revolution share vertices with smooth normals. All
 * triangles are counter-clockwise seen from outside. */
#ifndef UNBAKE_DEMO_SHAPES_H
#define UNBAKE_DEMO_SHAPES_H

#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "common/vec.h"
#include "server/scene/mesh.h"

struct shapes {
    struct mesh mesh;
    size_t vertex_capacity, triangle_capacity;
};

/* Faces of a box to omit, where they rest on something. */
enum {
    SHAPE_LEFT = 1,   /* -x */
    SHAPE_RIGHT = 2,  /* +x */
    SHAPE_BOTTOM = 4, /* -y */
    SHAPE_TOP = 8,    /* +y */
    SHAPE_BACK = 16,  /* -z */
    SHAPE_FRONT = 32, /* +z */
    SHAPE_INWARD = 64 /* a room: faces point inwards */
};

void shapes_init(struct shapes *s);

/* The faces of an axis-aligned box, except those in `without`. */
void shapes_box(struct shapes *s, int64_t object, vec3 lower, vec3 upper, int without);

/* A plane rectangle, its corners counter-clockwise seen from its front. */
void shapes_plane(struct shapes *s, int64_t object, const vec3 corner[4]);

/* The same with a rectangular hole, as four trapezoids: each edge has one triangle on either side. */
void shapes_plane_with_hole(struct shapes *s, int64_t object, const vec3 corner[4], const vec3 hole[4]);

/* Surface of revolution: the profile (x = radius, y = height, from bottom to top), rotated about the vertical axis
 * through `base` in `sides` steps. A radius of 0 at an end closes it. */
void shapes_lathe(struct shapes *s, int64_t object, vec3 base, const vec2 *profile, size_t count, int sides);

/* Writes positions, normals and object_id as binary little-endian PLY. */
enum status shapes_write_ply(const struct mesh *mesh, const char *path, struct error *err);

#endif
