/* mesh.h -- a triangle mesh as read from a bundle, and the checks that make it fit for use. */
#ifndef UNBAKE_SCENE_MESH_H
#define UNBAKE_SCENE_MESH_H

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "common/vec.h"

#define MESH_MAX_TRIANGLES ((size_t)1 << 28) /* that indices of corners, 3 t + c, have room for */
#define MESH_MAX_COORDINATE_M 1e6f           /* beyond it single precision resolves no room */

#define MESH_NO_FACE UINT32_MAX /* -1 in scene.ply */

struct mesh {
    size_t vertex_count;
    vec3 *position; /* [vertex_count] metres; owned */
    vec3 *normal;   /* [vertex_count] unit shading normals, or NULL; owned */
    size_t triangle_count;
    uint32_t (*index)[3]; /* [triangle_count] vertices, counter-clockwise from the front; owned */
    uint32_t *face;       /* [triangle_count] face of the input that the triangle was cut from,
                              * ascending; MESH_NO_FACE: added since, to fill a hole; owned */
    int64_t *object_id;   /* [triangle_count] the input's object_id, or NULL; owned */
    vec2 (*uv)[3];        /* [triangle_count] the input's own texture coordinates of the corners, from the lower left as
                              * OBJ has them; not finite: the face has none. NULL: no face has any; owned */
    size_t picture_count; /* of the input that its faces' base colour is looked up in with these; 0: not known */
    size_t name_count;
    char **name;       /* [name_count] of the object with that object_id in the input; none: NULL; owned */
    size_t face_count; /* faces of the input, the dropped ones included */
    double offset[3];  /* metres, whole; a position plus this is where the input has it. 0 unless the input lies so far
                       * from its origin that single precision would blur it (server/ingest/mesh/positions.h) */
};

struct mesh_report {
    size_t degenerate_count; /* triangles without area, dropped */
    size_t unused_count;     /* vertices of no triangle, not finite or too far away, dropped */
    size_t duplicate_count;  /* triangles on the same three positions as an earlier one, dropped */
};

void mesh_release(struct mesh *mesh);

/* Checks indices and the coordinates of vertices in use (STATUS_INPUT names the first bad face or vertex by its number,
 * from 0), then drops bad vertices that no triangle uses and degenerate and duplicate triangles, in place, keeping the
 * order. Of two coincident triangles a ray hits either, so
 * only the first can be measured. Normals are normalised; zero or non-finite ones are replaced by the mean of the
 * adjacent faces'. Fails when no triangle is left. `name` is for messages; report may be NULL. */
enum status mesh_check(struct mesh *mesh, const char *name, struct mesh_report *report, struct error *err);

/* Makes room for so many more vertices and triangles in the arrays that the mesh has; the counts stay. */
void mesh_reserve(struct mesh *mesh, size_t vertices, size_t triangles);

/* Swaps the second and the third corner. */
void mesh_turn_triangle(struct mesh *mesh, size_t triangle);

/* Whether the triangle has texture coordinates of the input. */
static inline bool mesh_has_uv(const struct mesh *mesh, size_t triangle) {
    const vec2 *c = mesh->uv ? mesh->uv[triangle] : NULL;
    return c && isfinite(c[0].x + c[0].y + c[1].x + c[1].y + c[2].x + c[2].y);
}

/* Copies triangle `from` with its face, object and texture coordinates over triangle `to`: to leave some out in
 * place. */
void mesh_move_triangle(struct mesh *mesh, size_t from, size_t to);

/* Maps each vertex to the lowest-numbered one at the same position (files repeat vertices where
 * normals differ). The result, [vertex_count], is the caller's (mem_free). */
uint32_t *mesh_weld(const struct mesh *mesh);

/* Twice the area times the unit geometric normal of a triangle, m^2. */
vec3 mesh_cross(const struct mesh *mesh, size_t triangle);
/* Area of a triangle, m^2. */
static inline float mesh_triangle_area(const struct mesh *mesh, size_t triangle) {
    return 0.5f * vec3_length(mesh_cross(mesh, triangle));
}
/* The point with barycentrics (1 - b1 - b2, b1, b2), metres. */
static inline vec3 mesh_point(const struct mesh *mesh, size_t triangle, float b1, float b2) {
    const uint32_t *v = mesh->index[triangle];
    vec3 p = vec3_scale(mesh->position[v[0]], 1.0f - b1 - b2);
    p = vec3_mad(p, b1, mesh->position[v[1]]);
    return vec3_mad(p, b2, mesh->position[v[2]]);
}
/* Name of the object, borrowed; NULL when the input has none for it. */
const char *mesh_object_name(const struct mesh *mesh, int64_t object_id);
double mesh_area(const struct mesh *mesh);                           /* total, m^2 */
void mesh_bounds(const struct mesh *mesh, vec3 *lower, vec3 *upper); /* of the triangles */

#endif
