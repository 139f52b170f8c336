/* mesh_ply.h -- the mesh with its atlas coordinates as a binary little-endian PLY (scene.ply).
 *
 *   vertex: float x y z, nx ny nz if the mesh has normals, float s t. Origin lower left: an image's top row is t = 1,
 *           its left column s = 0. Vertices on a seam between charts are repeated per chart. Where the input has
 *           texture coordinates of its own, float s1 t1 are these, with the same origin; 0 at faces that have none.
 *   face:   triangles, list uchar int vertex_indices; int segment as in the report; int face, the face of the input
 *           that the triangle is part of.
 *
 * Comments "segment N NAME" have what the input calls a segment, up to PLY_NAMES_BYTES of them.
 *
 * Triangles are in the input's order, without those dropped by mesh_check. */
#ifndef UNBAKE_EXPORT_MESH_PLY_H
#define UNBAKE_EXPORT_MESH_PLY_H

#include "common/error.h"
#include "server/scene/atlas.h"
#include "server/scene/mesh.h"
#include "server/scene/segment.h"

#define PLY_NAMES_BYTES 65536 /* readers hold a header in memory; ours take 1 MiB */

/* Replaces the file atomically. The same input gives the same bytes. */
enum status mesh_ply_write(const char *path, const struct mesh *mesh, const struct segments *segments,
                           const struct atlas *atlas, struct error *err);

#endif
