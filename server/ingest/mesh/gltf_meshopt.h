/* gltf_meshopt.h -- buffer views compressed by EXT_meshopt_compression or KHR_meshopt_compression, by way of the
 * library meshoptimizer. KHR has the same members and codecs, and two more: version 1 of the codec of vertices, which
 * is read where the library does, and the filter COLOR, which is for colours only and refused. */
#ifndef UNBAKE_INGEST_MESH_GLTF_MESHOPT_H
#define UNBAKE_INGEST_MESH_GLTF_MESHOPT_H

#include "server/ingest/mesh/gltf_file.h"

/* The extension of a buffer view by either name; NULL: it has none. */
const cJSON *gltf_meshopt_of(const cJSON *view);

/* Unpacks the view into g->unpacked, once; *bytes is borrowed from there. `extension` is the view's member.
 * STATUS_INPUT for damaged contents and for sizes that the compressed bytes cannot hold. */
enum status gltf_meshopt_unpack(struct gltf_file *g, size_t view, const cJSON *extension, struct gltf_bytes *bytes,
                                struct error *err);

/* "0.18" or so, of the library that is linked against. */
const char *gltf_meshopt_version(void);

#endif
