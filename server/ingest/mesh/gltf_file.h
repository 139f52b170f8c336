/* gltf_file.h -- a glTF 2.0 file (.glb or .gltf): its JSON and its buffers, which are the GLB's own, files below the
 * .gltf's folder, or base64 data: URIs. gltf_accessor.h reads numbers from them. */
#ifndef UNBAKE_INGEST_MESH_GLTF_FILE_H
#define UNBAKE_INGEST_MESH_GLTF_FILE_H

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

/* Bytes of a buffer view, or the rest of it. */
struct gltf_bytes {
    const uint8_t *data; /* NULL: there is no view */
    size_t size;
    uint64_t stride; /* of its elements, bytes */
};

struct gltf_file {
    const char *name, *folder; /* file name for messages; folder of external buffers, NULL: none */
    cJSON *json;
    struct gltf_list buffers, views, accessors, meshes, nodes, scenes;
    struct gltf_buffer *buffer; /* [buffers.count] */
    uint8_t **unpacked;         /* [views.count] contents of compressed views, NULL before they are used; owned */
};

/* `data` must stay until gltf_file_release, which must also be called after a failure. */
enum status gltf_file_open(struct gltf_file *g, const void *data, size_t size, const char *name, const char *folder,
                           struct error *err);
void gltf_file_release(struct gltf_file *g);

/* The member as an index into a list: STATUS_INPUT when it is not one. `where` names the object in messages
 * ("nodes[3]"). *found is false, without an error, when the member is absent. */
enum status gltf_index(const struct gltf_file *g, const cJSON *object, const char *key, const char *where,
                       const struct gltf_list *list, bool *found, size_t *index, struct error *err);

/* The member as a whole number from `least` to `most`; `fallback` when it is absent. The message calls it
 * "WHERE[INDEX].KEY". */
enum status gltf_whole(const struct gltf_file *g, const cJSON *object, const char *key, const char *where, size_t index,
                       double fallback, double least, double most, uint64_t *value, struct error *err);

#define GLTF_MAX_BYTES ((double)((uint64_t)1 << 40)) /* of offsets and lengths in files */
/* The part of a buffer that bufferViews[view] or an extension of it names by "buffer", "byteOffset" and "byteLength",
 * at least `least` bytes long; not yet held against the buffer's size. `where` as for gltf_index. */
enum status gltf_buffer_part(const struct gltf_file *g, const cJSON *object, const char *where, size_t view,
                             double least, size_t *buffer, uint64_t *offset, uint64_t *length, struct error *err);

/* The address with percent escapes decoded, of which invalid ones stay; the caller's. */
char *gltf_unescape(const char *uri);

/* The extension's object of a JSON object; NULL when there is none. */
const cJSON *gltf_extension(const cJSON *object, const char *extension);

#endif
