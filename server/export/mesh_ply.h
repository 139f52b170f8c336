/* mesh_ply.h -- the mesh with its atlas coordinates as a binary little-endian PLY (scene.ply).
 *
 *   vertex: float x y z, nx ny nz where the mesh has normals, float s t. Origin lower left: an
 *           image's top row is t = 1, its left column s = 0. A vertex on the seam of charts is
 *           there once for each.
 *   face:   triangles, list uchar int vertex_indices; int segment, the number that the report
 *           gives it; int face, the face of the input that the triangle was cut from.
 *
 * Triangles come in the input's order; those that the check of the mesh dropped are missing. */
#ifndef UNBAKE_EXPORT_MESH_PLY_H
#define UNBAKE_EXPORT_MESH_PLY_H

#include "common/error.h"
#include "server/scene/atlas.h"
#include "server/scene/mesh.h"
#include "server/scene/segment.h"

/* Replaces the file: a reader sees the old content or the new. The same input gives the same
 * bytes. */
enum status mesh_ply_write(const char *path, const struct mesh *mesh,
                           const struct segments *segments, const struct atlas *atlas,
                           struct error *err);

#endif
