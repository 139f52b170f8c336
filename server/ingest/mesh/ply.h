/* ply.h -- reads triangle meshes from PLY files.
 *
 * ASCII and binary of either byte order; properties in any order and of any type, in capitals or not; unused elements,
 * properties and lists are skipped. Uses of `vertex` x y z and nx ny nz if all three exist; of `face` the list
 * vertex_indices (or vertex_index) and an integer property object_id; texture coordinates from the
 * list `texcoord` of faces, else the pair s t, u v or texture_u texture_v of vertices; where there are no faces, the
 * same list of `tristrips` (triangle strips with -1 between them). Damage is STATUS_INPUT with the line or byte
 * offset. */
#ifndef UNBAKE_INGEST_MESH_PLY_H
#define UNBAKE_INGEST_MESH_PLY_H

#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "server/ingest/mesh/faces.h"
#include "server/scene/mesh.h"

/* Reads the file's content into *mesh, the caller's (mesh_release). Vertex indices are in range; geometry is not
 * checked (see mesh_check). STATUS_LIMIT for more than triangle_limit triangles. `name` is for messages; report may be
 * NULL. */
enum status ply_parse(const void *data, size_t size, const char *name, size_t triangle_limit, struct mesh *mesh,
                      struct faces_report *report, struct error *err);

/* Number of faces or strips in the header; 0 for a point cloud. */
enum status ply_count_faces(const char *path, const char *name, uint64_t *count, struct error *err);

#endif
