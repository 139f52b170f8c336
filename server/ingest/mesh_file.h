/* mesh_file.h -- a mesh in any of the formats that are read, told apart by the file's extension. */
#ifndef UNBAKE_INGEST_MESH_FILE_H
#define UNBAKE_INGEST_MESH_FILE_H

#include <stdbool.h>
#include <stddef.h>

#include "common/error.h"
#include "server/ingest/faces.h"
#include "server/scene/mesh.h"

#define MESH_FILE_FORMATS "PLY, OBJ or glTF" /* for messages */

/* Whether there is a reader for files of this name. */
bool mesh_file_is_known(const char *name);

/* As ply_read; a name of no known extension is taken for a PLY. */
enum status mesh_file_read(const char *path, const char *name, size_t triangle_limit, struct mesh *mesh,
                           struct faces_report *report, struct error *err);

/* *has: false for what is only a point cloud. What cannot be told before all of it is read, or is damaged, counts as a
 * mesh, so that reading it says what is wrong. Fails only where the disk does. */
enum status mesh_file_has_faces(const char *path, const char *name, bool *has, struct error *err);

#endif
