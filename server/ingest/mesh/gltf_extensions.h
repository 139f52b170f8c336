/* gltf_extensions.h -- which extensions of glTF a mesh can be read with.
 *
 *   read      KHR_mesh_quantization, EXT_ and KHR_meshopt_compression, EXT_mesh_gpu_instancing, KHR_node_visibility
 *   harmless  materials, textures, lights, animation, metadata: they do not move a surface
 *   refused   those that are known to hold or move surfaces, wherever the file uses them, and any other that it
 *             requires
 *
 * The rest may be left out of a picture according to the file itself; gltf_extensions_unknown names it for a
 * warning. */
#ifndef UNBAKE_INGEST_MESH_GLTF_EXTENSIONS_H
#define UNBAKE_INGEST_MESH_GLTF_EXTENSIONS_H

#include "server/ingest/mesh/gltf_file.h"

/* STATUS_INPUT with the extension's name, and a hint how to do without it. */
enum status gltf_extensions_check(const struct gltf_file *g, struct error *err);

/* The first extension used that is none of these; NULL: none. Borrowed. */
const char *gltf_extensions_unknown(const struct gltf_file *g);

#endif
