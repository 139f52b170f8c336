/* obj.h -- reads meshes from Wavefront OBJ files (appendix B1 of the Advanced Visualizer manual; polygons only, as
 * programs write them).
 *
 * Reads v (x y z), vn, f with indices from 1 or negative from the last, and the names of o, g and usemtl; vt as the
 * mesh's texture coordinates where all corners of a face have one; skips materials, lines, points and curves. Lines end
 * in LF, CR LF or CR; a byte order mark is skipped. A mesh vertex is a pair of position and normal; normals are used if
 * every corner of every face has one that is above it in the file. Each combination of object, group and material with
 * faces is an object_id with that name, numbered from 0 in order of first use (obj_objects.h); no object_id if there is
 * only one. */
#ifndef UNBAKE_INGEST_MESH_OBJ_H
#define UNBAKE_INGEST_MESH_OBJ_H

#include <stddef.h>

#include "common/error.h"
#include "server/ingest/mesh/faces.h"
#include "server/ingest/mesh/mesh_materials.h"
#include "server/scene/mesh.h"

/* As ply_parse; `folder` has the file's library of materials, NULL: none. Damage is STATUS_INPUT with the line of the
 * file. With `materials`, which may be NULL: materials, too; mesh->object_id are then their numbers in *materials. It
 * is the caller's (mesh_materials_release), also after a failure. */
enum status obj_parse(const void *data, size_t size, const char *name, const char *folder, size_t triangle_limit,
                      struct mesh *mesh, struct mesh_materials *materials, struct faces_report *report,
                      struct error *err);

#endif
