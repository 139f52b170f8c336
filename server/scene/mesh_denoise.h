/* mesh_denoise.h -- the vertices of a scanned mesh put back to where its surfaces are.
 *
 * A scanner misses by millimetres, every vertex by its own. A point of such a surface is then seen in another place by
 * each photograph, outlines are crumpled, and a carpet sinks into its floor here and there. So the normals of triangles
 * are filtered (face_normals.h), and vertices move until the triangles face that way (Sun et al. 2007). Edges stay.
 *
 * What is round and made of few triangles is flattened by that. So what moved a whole neighbourhood the same way is
 * taken back, and where vertices moved by more than noise elsewhere explains they move by less, as Wiener's filter has
 * it: there they end about as far off as they were. What is plane is then made plane (mesh_planes.h). */
#ifndef UNBAKE_SCENE_MESH_DENOISE_H
#define UNBAKE_SCENE_MESH_DENOISE_H

#include "common/parallel.h"
#include "server/scene/mesh.h"

/* Moves the vertices of a rough mesh. One that has normals, is smooth, or mostly of triangles with another one in their
 * plane, stays as it is. Coincident vertices stay together. Returns the standard deviation of the noise, metres, 0 where
 * nothing was moved. The same for any number of threads. */
float mesh_denoise(struct mesh *mesh, struct parallel *pool);

#endif
