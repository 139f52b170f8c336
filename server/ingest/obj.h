/* obj.h -- reading meshes from Wavefront OBJ files (appendix B1 of the Advanced Visualizer manual; the
 * polygonal part, which is what programs write).
 *
 * Taken are v (x y z), vn, f with indices from 1 or backwards from the last, and the names of o, g and
 * usemtl; texture coordinates, materials, lines, points and curves are skipped. A vertex of the mesh
 * is a pair of position and normal; normals count where every corner of a face has one. Each
 * combination of object, group and material that faces have becomes an object_id, numbered from 0 in
 * order of first use; where all have the same, there is none. */
#ifndef UNBAKE_INGEST_OBJ_H
#define UNBAKE_INGEST_OBJ_H

#include <stddef.h>

#include "common/error.h"
#include "server/ingest/faces.h"
#include "server/scene/mesh.h"

/* As ply_read and ply_parse. Damage is STATUS_INPUT with the line of the file. */
enum status obj_read(const char *path, const char *name, size_t triangle_limit, struct mesh *mesh,
                     struct faces_report *report, struct error *err);
enum status obj_parse(const void *data, size_t size, const char *name, size_t triangle_limit,
                      struct mesh *mesh, struct faces_report *report, struct error *err);

#endif
