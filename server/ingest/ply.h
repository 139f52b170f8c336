/* ply.h -- reading triangle meshes from PLY files.
 *
 * ASCII and binary of either byte order; properties in any order and of any type; elements,
 * properties and lists that nothing here needs are skipped. Taken are of `vertex` x y z and,
 * where all three are there, nx ny nz; of `face` the list vertex_indices (or vertex_index) and
 * an integer property object_id. Damage is STATUS_INPUT with the line or byte of the file. */
#ifndef UNBAKE_INGEST_PLY_H
#define UNBAKE_INGEST_PLY_H

#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "server/ingest/faces.h"
#include "server/scene/mesh.h"

/* Reads `path` into *mesh, the caller's (mesh_release); vertex numbers are in range, nothing
 * else about the geometry is checked (mesh_check does). More than triangle_limit triangles are
 * STATUS_LIMIT. `name` is the file's name in messages; report may be NULL. */
enum status ply_read(const char *path, const char *name, size_t triangle_limit, struct mesh *mesh,
                     struct faces_report *report, struct error *err);

/* The same from memory. */
enum status ply_parse(const void *data, size_t size, const char *name, size_t triangle_limit,
                      struct mesh *mesh, struct faces_report *report, struct error *err);

/* How many faces the header promises; 0 for a point cloud. */
enum status ply_count_faces(const char *path, const char *name, uint64_t *count, struct error *err);

#endif
