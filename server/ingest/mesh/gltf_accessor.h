/* gltf_accessor.h -- reads numbers through a glTF file's accessors: plain, normalised, sparse, or in views compressed
 * by meshopt. An accessor is checked to lie within its buffers before it is read. */
#ifndef UNBAKE_INGEST_MESH_GLTF_ACCESSOR_H
#define UNBAKE_INGEST_MESH_GLTF_ACCESSOR_H

#include <stdbool.h>

#include "server/ingest/mesh/gltf_file.h"

enum gltf_component { GLTF_BYTE = 5120, GLTF_UBYTE, GLTF_SHORT, GLTF_USHORT, GLTF_UINT = 5125, GLTF_FLOAT };

struct gltf_span {
    const uint8_t *data;
    size_t count, stride; /* stride in bytes */
    enum gltf_component component;
    bool is_normalized; /* integers stand for [0, 1] or [-1, 1] */
    uint8_t *own;       /* contents of a sparse accessor; owned */
};

/* The elements of accessor `index`, which must be of `type` ("SCALAR", "VEC3", "VEC4"). The caller's
 * (gltf_span_release), also after a failure. */
enum status gltf_span(struct gltf_file *g, size_t index, const char *type, struct gltf_span *span, struct error *err);
void gltf_span_release(struct gltf_span *span);

/* The bytes of the member "bufferView" of `object`, which is WHERE[INDEX] in messages; data is NULL where it has
 * none. */
enum status gltf_view(struct gltf_file *g, const cJSON *object, const char *where, size_t index,
                      struct gltf_bytes *bytes, struct error *err);

/* Reads `width` numbers of an element, by its component type and normalisation (3.11). */
void gltf_read_vector(const struct gltf_span *span, size_t at, size_t width, double *value);
/* Reads an unsigned integer of any size. */
uint32_t gltf_read_index(const struct gltf_span *span, size_t at);

#endif
