/* mesh_denoise.h -- removes scanner noise from the vertices of a mesh.
 *
 * Vertices of a scan are off by millimetres, independently. Photographs then see one surface point in different
 * places, silhouettes are jagged, and a carpet intersects its floor. Triangle normals are filtered (face_normals.h)
 * and vertices are moved until the triangles have these normals (Sun et al. 2007). Edges survive. Where noise is as
 * large as triangles normals tell nothing: vertices are averaged first, until they do.
 *
 * The filter flattens curved surfaces of few triangles. So the mean displacement of a neighbourhood is undone, and
 * where displacements exceed the noise they are shrunk by a Wiener factor. Then planar regions are flattened
 * (mesh_planes.h) and curved ones smoothed (mesh_round.h). */
#ifndef UNBAKE_SCENE_MESH_DENOISE_H
#define UNBAKE_SCENE_MESH_DENOISE_H

#include "common/parallel.h"
#include "server/scene/mesh.h"

/* Denoises the mesh in place. It stays unchanged if it has normals, is smooth, or if most triangles have a coplanar
 * neighbour (a modelled mesh). Coincident vertices stay together. Returns the standard deviation of the noise in
 * metres, 0 if nothing moved. The result does not depend on the number of threads. */
float mesh_denoise(struct mesh *mesh, struct parallel *pool);

#endif
