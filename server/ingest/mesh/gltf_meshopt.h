/* gltf_meshopt.h -- buffer views compressed by EXT_meshopt_compression, by way of the library meshoptimizer. */
#ifndef UNBAKE_INGEST_MESH_GLTF_MESHOPT_H
#define UNBAKE_INGEST_MESH_GLTF_MESHOPT_H

#include "server/ingest/mesh/gltf_file.h"

/* Unpacks the view into g->unpacked, once; *bytes is borrowed from there. `extension` is the view's member. STATUS_INPUT
 * for damaged contents and for sizes that the compressed bytes cannot hold. */
enum status gltf_meshopt_unpack(struct gltf_file *g, size_t view, const cJSON *extension, struct gltf_bytes *bytes,
                                struct error *err);

/* "0.18" or so, of the library that is linked against. */
const char *gltf_meshopt_version(void);

#endif
