/* gltf_file.h -- a glTF 2.0 file (.glb or .gltf): its JSON, buffers and accessors. Accessors are checked to lie
 * within their buffers before they are read.
 *
 * Buffers are the GLB's own, files below the .gltf's folder, or base64 data: URIs. Sparse and compressed accessors
 * are refused. */
#ifndef UNBAKE_INGEST_GLTF_FILE_H
#define UNBAKE_INGEST_GLTF_FILE_H

#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "common/json.h"
#include "server/ingest/mapping.h"

/* The elements of a top-level array of the JSON, by index. */
struct gltf_list {
    const char *key;
    size_t count;
    const cJSON **item; /* [count]; owned */
};

struct gltf_buffer {
    const uint8_t *data; /* NULL: not available, for the reason `problem` */
    size_t size;
    struct mapping file;
    uint8_t *decoded; /* owned */
};

struct gltf_file {
    const char *name, *folder; /* file name for messages; folder of external buffers, NULL: none */
    cJSON *json;
    struct gltf_list buffers, views, accessors, meshes, nodes, scenes;
    struct gltf_buffer *buffer; /* [buffers.count] */
};

/* `data` must stay until gltf_file_release, which must also be called after a failure. */
enum status gltf_file_open(struct gltf_file *g, const void *data, size_t size, const char *name, const char *folder,
                           struct error *err);
void gltf_file_release(struct gltf_file *g);

/* The member as an index into a list: STATUS_INPUT when it is not one. `where` names the object in messages
 * ("nodes[3]"). *found is false, without an error, when the member is absent. */
enum status gltf_index(const struct gltf_file *g, const cJSON *object, const char *key, const char *where,
                       const struct gltf_list *list, bool *found, size_t *index, struct error *err);

enum gltf_component { GLTF_BYTE = 5120, GLTF_UBYTE, GLTF_SHORT, GLTF_USHORT, GLTF_UINT = 5125, GLTF_FLOAT };

struct gltf_span {
    const uint8_t *data;
    size_t count, stride; /* stride in bytes */
    enum gltf_component component;
};

/* The elements of accessor `index`, which must be of `type` ("VEC3", "SCALAR"). */
enum status gltf_span(const struct gltf_file *g, size_t index, const char *type, struct gltf_span *span,
                      struct error *err);

/* Read three floats; read an unsigned integer of any width. */
void gltf_read_vec3(const struct gltf_span *span, size_t at, float value[3]);
uint32_t gltf_read_index(const struct gltf_span *span, size_t at);

#endif
