/* mesh_round.h -- smooths the curved parts of a scanned mesh.
 *
 * On a vase of a thousand triangles noise and curvature are of one size, so no normal filter separates them. A
 * paraboloid through a few dozen vertices fits the surface and halves the error of the vertex in its middle. The
 * neighbourhood grows as long as the paraboloid fits (Lepski's method, 1991). */
#ifndef UNBAKE_SCENE_MESH_ROUND_H
#define UNBAKE_SCENE_MESH_ROUND_H

#include "common/parallel.h"
#include "server/scene/mesh_planes.h"

/* Moves the vertices that are neither on a plane nor on an edge. measured[vertex_count] are the scanned positions,
 * with noise of standard deviation noise_m along the normal. Coincident vertices stay together. The result does not
 * depend on the number of threads. */
void mesh_round_smooth(struct mesh *mesh, const vec3 *measured, float noise_m, const struct face_normals *faces,
                       const struct mesh_planes *planes, struct parallel *pool);

#endif
