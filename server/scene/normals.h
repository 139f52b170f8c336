/* normals.h -- shading normals for a mesh without any.
 *
 * Triangle normals of a scan are noisy; flat shading would make a wall facetted, and base colour would compensate for
 * it. So triangle normals are filtered (face_normals.h) and averaged per vertex, except across edges. Planar surfaces
 * keep their normals bit by bit. */
#ifndef UNBAKE_SCENE_NORMALS_H
#define UNBAKE_SCENE_NORMALS_H

#include "common/parallel.h"
#include "server/scene/mesh.h"

/* Adds shading normals, unless the mesh has some or flat shading is exact. Vertices on edges are split; positions and
 * indices may be reallocated. *roughness is that of face_normals.h. Returns whether the mesh has normals. The result
 * does not depend on the number of threads. */
bool normals_estimate(struct mesh *mesh, struct parallel *pool, float *roughness);

#endif
