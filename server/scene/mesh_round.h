/* mesh_round.h -- what is round in a rough mesh made smooth.
 *
 * A vase of a thousand triangles is as rough as it is round, so no filter of its normals mends it. But through some dozens
 * of its vertices a paraboloid fits as well as their noise lets it, and says where the one in their midst is to half that
 * noise. It takes as many as it fits (after Lepski 1991). */
#ifndef UNBAKE_SCENE_MESH_ROUND_H
#define UNBAKE_SCENE_MESH_ROUND_H

#include "common/parallel.h"
#include "server/scene/mesh_planes.h"

/* Moves the vertices none of whose triangles lie in a plane and through which no edge runs, where enough of those near
 * fit: `measured`, [vertex_count], is where they were seen, off by noise_m (standard deviation along the surface's
 * normal). Coincident vertices stay together. The same for any number of threads. */
void mesh_round_smooth(struct mesh *mesh, const vec3 *measured, float noise_m, const struct face_normals *faces,
                       const struct mesh_planes *planes, struct parallel *pool);

#endif
