/* mesh_file.h -- reads a mesh in any supported format, chosen by the file's extension. */
#ifndef UNBAKE_INGEST_MESH_MESH_FILE_H
#define UNBAKE_INGEST_MESH_MESH_FILE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "server/ingest/findings.h"
#include "server/ingest/mesh/faces.h"
#include "server/ingest/mesh/mesh_materials.h"
#include "server/scene/mesh.h"

/* Whether the name has an extension of a supported format. */
bool mesh_file_is_known(const char *name);

/* Reads `path` into *mesh, the caller's (mesh_release). Vertex indices are in range; geometry is not checked (see
 * mesh_check). STATUS_LIMIT for more than triangle_limit triangles. Unknown extensions are read as PLY. `name` is for
 * messages; report may be NULL. */
enum status mesh_file_read(const char *path, const char *name, size_t triangle_limit, struct mesh *mesh,
                           struct faces_report *report, struct error *err);

/* The same with what the file says of its surfaces: mesh->object_id are numbers of materials and mesh->uv are as the
 * file has them, without transforms of pictures. A PLY says nothing: no material, and no object_id. The materials is
 * the caller's (mesh_materials_release), also after a failure. */
enum status mesh_file_read_materials(const char *path, const char *name, size_t triangle_limit, struct mesh *mesh,
                                     struct mesh_materials *materials, struct faces_report *report, struct error *err);

/* Warns of what was left out or changed: by the reader (report) and by mesh_check (check). */
void mesh_file_warn(const char *name, const struct mesh *mesh, const struct faces_report *report,
                    const struct mesh_report *check, struct findings *f);

/* *has: false for a point cloud. Files that would have to be read whole to know, or are damaged, count as meshes, so
 * that reading them reports the error. Fails only on I/O errors. */
enum status mesh_file_has_faces(const char *path, const char *name, bool *has, struct error *err);

/* Faces of a PLY file; 1 where the file is damaged, so that reading it reports the error. */
enum status mesh_file_count_faces(const char *path, const char *name, uint64_t *count, struct error *err);

#endif
