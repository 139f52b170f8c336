/* gltf_uv.h -- texture coordinates of glTF's primitives: those by which the picture of the material's base colour is
 * looked up (glTF 2.0 specification, 3.9.3; KHR_texture_transform), else TEXCOORD_0. */
#ifndef UNBAKE_INGEST_MESH_GLTF_UV_H
#define UNBAKE_INGEST_MESH_GLTF_UV_H

#include <stdbool.h>
#include <stddef.h>

#include "common/vec.h"
#include "server/ingest/mesh/gltf_accessor.h"

struct gltf_uv {
    bool is_there;
    struct gltf_span span;
    double transform[2][3]; /* of (u, v, 1), from the upper left */
};

/* Those of a primitive with `vertex_count` vertices. Fails, with *uv released, where they are damaged. */
enum status gltf_uv_open(struct gltf_uv *uv, struct gltf_file *g, const cJSON *primitive, const char *where,
                         size_t vertex_count, struct error *err);
/* The same of TEXCOORD_set, without a transform. */
enum status gltf_uv_open_set(struct gltf_uv *uv, struct gltf_file *g, const cJSON *primitive, double set,
                             const char *where, size_t vertex_count, struct error *err);
void gltf_uv_release(struct gltf_uv *uv);

/* Those of a vertex, from the lower left as struct mesh has them. They must be there. */
vec2 gltf_uv_read(const struct gltf_uv *uv, size_t vertex);

/* Number of the image of the primitive's base colour; -1: none. */
int gltf_uv_picture(const struct gltf_file *g, const cJSON *primitive);

#endif
