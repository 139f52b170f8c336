/* mesh_planes.h -- what is plane in a rough mesh made plane.
 *
 * Each vertex that a scanner sees on a wall is off by millimetres, the plane through a thousand of them by a tenth of one.
 * So parts are grown from triangle to triangle, a plane is fitted to each, and vertices go to the plane, or to where
 * several meet, as far as those are surer than they are. What is curved more than noise explains (an F-test against a
 * paraboloid), or has too few vertices, is left alone. */
#ifndef UNBAKE_SCENE_MESH_PLANES_H
#define UNBAKE_SCENE_MESH_PLANES_H

#include "server/scene/face_normals.h"
#include "server/scene/height_fit.h"
#include "server/scene/mesh.h"

#define MESH_PLANES_NONE UINT32_MAX

struct mesh_plane {
    struct height_frame frame; /* heights over it are 0 */
    struct height_fit fit;     /* what tells how surely */
};

struct mesh_planes {
    size_t count;
    struct mesh_plane *plane; /* [count] owned */
    uint32_t *part;           /* [triangle_count] the plane that a triangle lies in, or MESH_PLANES_NONE; owned */
};

/* The planes of a mesh whose noise was filtered. `measured`, [vertex_count], is where its vertices were before, off by
 * noise_m > 0 (standard deviation along the surface's normal); `faces` are of the mesh as it is now. */
void mesh_planes_find(struct mesh_planes *planes, const struct mesh *mesh, const vec3 *measured, float noise_m,
                      const struct face_normals *faces);
void mesh_planes_release(struct mesh_planes *planes);

/* Moves the vertices of the planes' triangles. Coincident ones stay together. */
void mesh_planes_flatten(const struct mesh_planes *planes, struct mesh *mesh, const struct face_normals *faces);

#endif
