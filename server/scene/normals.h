/* normals.h -- shading normals for a mesh that comes without any.
 *
 * Scanned surfaces are rough by millimetres, and each triangle of a wall looks another way. Shaded as it stands the
 * wall would be facetted, and base colour would have to make up for it. So normals are estimated: those of the
 * triangles with their roughness filtered out (face_normals.h); then corners that meet in a vertex get one normal,
 * unless an edge is between them. What is plane stays so to the bit. */
#ifndef UNBAKE_SCENE_NORMALS_H
#define UNBAKE_SCENE_NORMALS_H

#include "common/parallel.h"
#include "server/scene/mesh.h"

/* Gives the mesh normals, unless it has some or every triangle is to be shaded as it stands. Vertices at which edges
 * meet are doubled; positions and indices may be new arrays then. *roughness: by how much neighbours' normals differ
 * (length of the difference; half the triangles have a quarter of their neighbours nearer). Returns whether there are
 * normals now. The same for any number of threads. */
bool normals_estimate(struct mesh *mesh, struct parallel *pool, float *roughness);

#endif
