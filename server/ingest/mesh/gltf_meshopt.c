/* gltf_meshopt.c -- see gltf_meshopt.h. The rules for strides and counts are those of the extension's specification;
 * the library asserts them, so that they are checked first. */
#include "server/ingest/mesh/gltf_meshopt.h"

#include <meshoptimizer.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "common/mem.h"

#define MAX_STRIDE 256 /* bytes, of the extension */
/* Unpacked bytes per compressed one, at most: a group of 16 equal bytes takes 2 bits, a triangle of 12 bytes one. */
#define MAX_RATIO 64
#define SLACK_BYTES 65536 /* of unpacked bytes, for files with few */

#define VERTEX_CODEC 0xa0 /* upper half of its first byte */
#define WITHOUT_COMPRESSION                                                                                            \
    "write it as EXT_meshopt_compression or without compression: gltfpack -noq -i IN.glb -o OUT.glb"

enum packing { PACKED_ATTRIBUTES, PACKED_TRIANGLES, PACKED_INDICES, PACKING_COUNT };
enum meshopt_filter { FILTER_NONE, FILTER_OCTAHEDRAL, FILTER_QUATERNION, FILTER_EXPONENTIAL, FILTER_COUNT };

struct meshopt_packed {
    const uint8_t *data;
    size_t size;
    uint64_t count, stride;
    enum packing mode;
    enum meshopt_filter filter;
};

/* The member's place among `count` words; `fallback` when it is absent, `count` when it is none of them. */
static int word_of(const cJSON *object, const char *key, const char *const *word, int count, int fallback) {
    const cJSON *member = cJSON_GetObjectItemCaseSensitive(object, key);
    const char *own = cJSON_GetStringValue(member);
    if (!member)
        return fallback;
    for (int i = 0; own && i < count; i++)
        if (strcmp(own, word[i]) == 0)
            return i;
    return count;
}

static enum status read_packed(const struct gltf_file *g, size_t view, const cJSON *extension, struct meshopt_packed *p,
                               struct error *err) {
    static const char *const mode[] = {"ATTRIBUTES", "TRIANGLES", "INDICES"};
    static const char *const filter[] = {"NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL"};
    char where[64];
    size_t b;
    uint64_t offset, length;
    snprintf(where, sizeof where, "bufferViews[%zu].%s", view, extension->string);
    enum status status = gltf_buffer_part(g, extension, where, view, 1.0, &b, &offset, &length, err);
    if (status == STATUS_OK)
        status = gltf_whole(g, extension, "byteStride", "bufferViews", view, -1.0, 1.0, MAX_STRIDE, &p->stride, err);
    if (status == STATUS_OK)
        status = gltf_whole(g, extension, "count", "bufferViews", view, -1.0, 1.0, UINT32_MAX, &p->count, err);
    if (status != STATUS_OK)
        return status;
    if (offset + length > g->buffer[b].size)
        return error_set(err, STATUS_INPUT, "%s: %s does not lie within the %zu bytes of buffers[%zu]", g->name, where,
                         g->buffer[b].size, b);
    p->mode = (enum packing)word_of(extension, "mode", mode, PACKING_COUNT, PACKING_COUNT);
    p->filter = (enum meshopt_filter)word_of(extension, "filter", filter, FILTER_COUNT, FILTER_NONE);
    p->data = g->buffer[b].data + offset;
    p->size = (size_t)length;
    return STATUS_OK;
}

/* Whether the specification allows it, and the bytes can hold it. */
static bool is_possible(const struct meshopt_packed *p) {
    bool index_size = p->stride == 2 || p->stride == 4;
    if (p->count * p->stride > MAX_RATIO * (uint64_t)p->size + SLACK_BYTES)
        return false;
    switch (p->mode) {
    case PACKED_TRIANGLES: return index_size && p->count % 3 == 0 && p->filter == FILTER_NONE;
    case PACKED_INDICES: return index_size && p->filter == FILTER_NONE;
    case PACKED_ATTRIBUTES:
        return p->stride % 4 == 0 && p->filter != FILTER_COUNT &&
               (p->filter != FILTER_OCTAHEDRAL || p->stride == 4 || p->stride == 8) &&
               (p->filter != FILTER_QUATERNION || p->stride == 8);
    default: return false;
    }
}

static bool decode(const struct meshopt_packed *p, uint8_t *out) {
    int failed = p->mode == PACKED_TRIANGLES ? meshopt_decodeIndexBuffer(out, p->count, p->stride, p->data, p->size)
                 : p->mode == PACKED_INDICES ? meshopt_decodeIndexSequence(out, p->count, p->stride, p->data, p->size)
                                             : meshopt_decodeVertexBuffer(out, p->count, p->stride, p->data, p->size);
    if (failed)
        return false;
    if (p->filter == FILTER_OCTAHEDRAL)
        meshopt_decodeFilterOct(out, p->count, p->stride);
    else if (p->filter == FILTER_QUATERNION)
        meshopt_decodeFilterQuat(out, p->count, p->stride);
    else if (p->filter == FILTER_EXPONENTIAL)
        meshopt_decodeFilterExp(out, p->count, p->stride);
    return true;
}

/* Version of the codec, which the first byte has in its lower half; 0 for others than vertices. */
static int codec_version(const struct meshopt_packed *p) {
    return p->mode == PACKED_ATTRIBUTES && p->size > 0 && (p->data[0] & 0xf0) == VERTEX_CODEC ? p->data[0] & 0x0f : 0;
}

static enum status refuse(const struct gltf_file *g, size_t view, const cJSON *extension,
                          const struct meshopt_packed *p, struct error *err) {
    const char *filter = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(extension, "filter"));
    int version = codec_version(p);
    if (filter && strcmp(filter, "COLOR") == 0) {
        error_set(err, STATUS_INPUT, "%s: bufferViews[%zu] has meshopt's filter COLOR, which is not read", g->name,
                  view);
        return error_hint(err, WITHOUT_COMPRESSION);
    }
    if (version > 0) {
        error_set(err, STATUS_INPUT,
                  "%s: bufferViews[%zu] is compressed by version %d of meshopt's vertex codec, which this build's "
                  "meshoptimizer %s does not read, or damaged",
                  g->name, view, version, gltf_meshopt_version());
        return error_hint(err, WITHOUT_COMPRESSION);
    }
    return error_set(err, STATUS_INPUT, "%s: bufferViews[%zu] is compressed by meshopt and damaged", g->name, view);
}

const cJSON *gltf_meshopt_of(const cJSON *view) {
    const cJSON *ratified = gltf_extension(view, "KHR_meshopt_compression");
    return ratified ? ratified : gltf_extension(view, "EXT_meshopt_compression");
}

enum status gltf_meshopt_unpack(struct gltf_file *g, size_t view, const cJSON *extension, struct gltf_bytes *bytes,
                                struct error *err) {
    struct meshopt_packed p;
    enum status status = read_packed(g, view, extension, &p, err);
    if (status != STATUS_OK)
        return status;
    if (!g->unpacked[view] && is_possible(&p)) {
        uint8_t *out = mem_alloc((size_t)(p.count * p.stride));
        if (decode(&p, out))
            g->unpacked[view] = out;
        else
            mem_free(out);
    }
    if (!g->unpacked[view])
        return refuse(g, view, extension, &p, err);
    *bytes = (struct gltf_bytes){g->unpacked[view], (size_t)(p.count * p.stride), p.stride};
    return STATUS_OK;
}

/* The header has 1000 times the version. */
#define DIGIT(place) ('0' + MESHOPTIMIZER_VERSION / (place) % 10)

const char *gltf_meshopt_version(void) {
    static const char text[] = {DIGIT(1000), '.', DIGIT(100), DIGIT(10), '\0'};
    return text;
}
