/* gltf.h -- reads meshes from glTF 2.0 files, .glb and .gltf.
 *
 * Reads all triangles of the default scene (else the first scene, else all nodes), with node transforms applied, in
 * the file's metres and axes; quantised, sparse and meshopt-compressed ones, and all instances (gltf_extensions.h).
 * Points, lines, materials, cameras and lights are skipped. Skinned meshes are read as they are stored, in the pose
 * that they were bound in, and without morph targets: rooms have neither, and both are told in the report. Normals are
 * used if all primitives have them. Each pair of node and material is an object_id with their names (gltf_objects.h);
 * no object_id if there is only one pair. */
#ifndef UNBAKE_INGEST_MESH_GLTF_H
#define UNBAKE_INGEST_MESH_GLTF_H

#include <stddef.h>

#include "common/error.h"
#include "server/ingest/mesh/faces.h"
#include "server/ingest/mesh/mesh_materials.h"
#include "server/scene/mesh.h"

/* As ply_parse; `folder` contains the file's external buffers, NULL: none are allowed. With `materials`, which may be
 * NULL: materials, too; mesh->object_id are then their numbers in *materials. It is the caller's
 * (mesh_materials_release), also after a failure. */
enum status gltf_parse(const void *data, size_t size, const char *name, const char *folder, size_t triangle_limit,
                       struct mesh *mesh, struct mesh_materials *materials, struct faces_report *report,
                       struct error *err);

#endif
