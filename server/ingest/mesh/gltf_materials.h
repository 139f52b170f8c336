/* gltf_materials.h -- the materials of a glTF file (glTF 2.0 specification, 3.9; KHR_materials_emissive_strength, _ior,
 * _specular; KHR_texture_transform). What they have beside that is counted as unread. Emission is radiance: an
 * emissive factor of 1 is radiance 1. */
#ifndef UNBAKE_INGEST_MESH_GLTF_MATERIALS_H
#define UNBAKE_INGEST_MESH_GLTF_MATERIALS_H

#include "server/ingest/mesh/gltf_file.h"
#include "server/ingest/mesh/mesh_materials.h"

/* Adds all materials, and behind them the one of primitives without any. is_used[materials + 1] says whose pictures are
 * read; it may be NULL: none are. */
enum status gltf_materials_read(struct gltf_file *g, const bool *is_used, struct mesh_materials *materials,
                                struct error *err);

/* How many materials the file has. */
size_t gltf_materials_count(const struct gltf_file *g);

/* Which texture coordinates a material's pictures use; -1: it has none. STATUS_INPUT where they use several. */
enum status gltf_materials_uv_set(const struct gltf_file *g, size_t material, int *set, struct error *err);

#endif
