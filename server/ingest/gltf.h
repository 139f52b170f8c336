/* gltf.h -- reading meshes from glTF 2.0 files, .glb and .gltf.
 *
 * All triangles of the default scene (where none is named: of the first; where there is none: of all
 * nodes), with their nodes' transforms applied, in the file's metres and axes. Points, lines,
 * materials, cameras and lights are skipped; skins and morph targets stay in their rest pose. Normals
 * count where all have them. Each pair of node and material is an object_id, numbered from 0 in the
 * order in which the tree of nodes is walked; where there is only one, there is none. */
#ifndef UNBAKE_INGEST_GLTF_H
#define UNBAKE_INGEST_GLTF_H

#include <stddef.h>

#include "common/error.h"
#include "server/ingest/faces.h"
#include "server/scene/mesh.h"

/* As ply_read and ply_parse; `folder` is where the file's buffers are, NULL: only in it. */
enum status gltf_read(const char *path, const char *name, size_t triangle_limit, struct mesh *mesh,
                      struct faces_report *report, struct error *err);
enum status gltf_parse(const void *data, size_t size, const char *name, const char *folder,
                       size_t triangle_limit, struct mesh *mesh, struct faces_report *report,
                       struct error *err);

#endif
