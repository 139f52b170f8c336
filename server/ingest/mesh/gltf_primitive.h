/* gltf_primitive.h -- adds the triangles of glTF's primitives to a mesh (glTF 2.0 specification, 3.7.2). */
#ifndef UNBAKE_INGEST_MESH_GLTF_PRIMITIVE_H
#define UNBAKE_INGEST_MESH_GLTF_PRIMITIVE_H

#include <stdbool.h>

#include "server/ingest/mesh/faces.h"
#include "server/ingest/mesh/gltf_file.h"
#include "server/ingest/mesh/gltf_node.h"
#include "server/ingest/mesh/positions.h"

enum { GLTF_TRIANGLES = 4, GLTF_STRIP, GLTF_FAN }; /* modes with triangles */

/* A mesh being read. */
struct gltf_surface {
    struct gltf_file *file;
    struct mesh *mesh;
    struct faces *faces;
    struct positions position;
    size_t normal_capacity;
    bool lacks_normals;   /* a primitive without normals */
    size_t morphed_count; /* primitives with morph targets, which are left out */
    size_t no_uv_count;   /* primitives whose texture coordinates are damaged, which are left out */
    size_t colored_count; /* primitives with colours of their vertices */
    int64_t object_id;    /* of the triangles being added */
    bool with_materials;  /* texture coordinates are those of uv_set as the file has them, and must be there: */
    int uv_set;           /* which the pictures of the primitive's material use; -1: it has none */
    struct error *err;
};

/* Adds a primitive of one of these modes, moved by t. `where` names it in messages. */
enum status gltf_surface_add(struct gltf_surface *s, const cJSON *primitive, const char *where, int mode,
                             const struct affine *t);

#endif
