/* mesh_planes.h -- finds the planar regions of a scanned mesh and flattens them.
 *
 * A scanned vertex on a wall is off by millimetres; the plane through a thousand of them by a tenth of a millimetre.
 * Regions grow from triangle to triangle, a plane is fitted to each, and vertices move to the plane, or to where
 * several planes meet, weighted by the variances of both. Regions that are significantly curved (F-test against a
 * paraboloid) or have too few vertices stay as they are. */
#ifndef UNBAKE_SCENE_MESH_PLANES_H
#define UNBAKE_SCENE_MESH_PLANES_H

#include "server/scene/face_normals.h"
#include "server/scene/height_fit.h"
#include "server/scene/mesh.h"

#define MESH_PLANES_NONE UINT32_MAX /* in place of a plane */

struct mesh_plane {
    struct height_frame frame; /* the plane is height 0 over this frame */
    struct height_fit fit;     /* with the covariance of the plane */
};

struct mesh_planes {
    size_t count;
    struct mesh_plane *plane; /* [count] owned */
    uint32_t *region;         /* [triangle_count] index of the triangle's plane, or MESH_PLANES_NONE; owned */
};

/* Finds the planes of a mesh whose normals were filtered. measured[vertex_count] are the positions before filtering,
 * with noise of standard deviation noise_m > 0 along the normal; `faces` belong to the mesh as it is now. */
void mesh_planes_find(struct mesh_planes *planes, const struct mesh *mesh, const vec3 *measured, float noise_m,
                      const struct face_normals *faces);
void mesh_planes_release(struct mesh_planes *planes);

/* Moves the vertices of the planes' triangles. Coincident vertices stay together. */
void mesh_planes_flatten(const struct mesh_planes *planes, struct mesh *mesh, const struct face_normals *faces);

#endif
