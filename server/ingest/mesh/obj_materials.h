/* obj_materials.h -- the materials of an OBJ file: those that usemtl names, in the library of mtllib. */
#ifndef UNBAKE_INGEST_MESH_OBJ_MATERIALS_H
#define UNBAKE_INGEST_MESH_OBJ_MATERIALS_H

#include "server/ingest/mesh/mesh_materials.h"
#include "server/ingest/mesh/obj_objects.h"

/* Turns mesh->object_id, objects of o, into numbers of *materials, which are read from the library. A
 * library or material that is not there is told in the report. `name` is the OBJ file's, for messages. */
enum status obj_materials_settle(const struct obj_objects *o, const char *name, const char *folder, struct mesh *mesh,
                                 struct mesh_materials *materials, struct faces_report *report, struct error *err);

#endif
