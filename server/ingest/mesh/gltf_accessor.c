/* gltf_accessor.c -- see gltf_accessor.h. Sections are those of the glTF 2.0 specification. */
#include "server/ingest/mesh/gltf_accessor.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "common/mem.h"
#include "server/ingest/mesh/gltf_meshopt.h"

#define MAX_ZEROS ((uint64_t)1 << 26) /* elements of a sparse accessor without a view to start from */

static uint32_t word_at(const uint8_t *at) {
    return (uint32_t)at[0] | (uint32_t)at[1] << 8 | (uint32_t)at[2] << 16 | (uint32_t)at[3] << 24;
}

static size_t component_bytes(uint64_t component) {
    switch (component) {
    case GLTF_BYTE:
    case GLTF_UBYTE: return 1;
    case GLTF_SHORT:
    case GLTF_USHORT: return 2;
    case GLTF_UINT:
    case GLTF_FLOAT: return 4;
    default: return 0;
    }
}

static size_t width_of(const char *type) { return strcmp(type, "SCALAR") == 0 ? 1 : (size_t)(type[3] - '0'); }

/* --- views (3.6.1) ------------------------------------------------------------------------- */

static enum status open_plain_view(const struct gltf_file *g, size_t v, const char *user, struct gltf_bytes *bytes,
                                   struct error *err) {
    const cJSON *view = g->views.item[v];
    char where[48];
    size_t b;
    uint64_t offset, size;
    snprintf(where, sizeof where, "bufferViews[%zu]", v);
    enum status status = gltf_buffer_part(g, view, where, v, 0.0, &b, &offset, &size, err);
    if (status != STATUS_OK)
        return status;
    if (offset + size > g->buffer[b].size)
        return error_set(err, STATUS_INPUT,
                         "%s: bufferViews[%zu] with %s does not lie within the %zu bytes of buffers[%zu]", g->name, v,
                         user, g->buffer[b].size, b);
    bytes->data = g->buffer[b].data + offset;
    bytes->size = (size_t)size;
    return STATUS_OK;
}

/* The member "bufferView" of `object`, from its "byteOffset" on; data is NULL where it has none. `user` is
 * "WHERE[INDEX]", for messages; `element` is the stride of views that do not state one. */
static enum status open_view(struct gltf_file *g, const cJSON *object, const char *where, size_t index, size_t element,
                             struct gltf_bytes *bytes, struct error *err) {
    char user[64];
    bool found;
    size_t v;
    uint64_t offset;
    *bytes = (struct gltf_bytes){.stride = element};
    snprintf(user, sizeof user, "%s[%zu]", where, index);
    enum status status = gltf_index(g, object, "bufferView", user, &g->views, &found, &v, err);
    if (status != STATUS_OK || !found)
        return status;
    const cJSON *view = g->views.item[v], *packed = gltf_meshopt_of(view);
    if (packed) {
        status = gltf_meshopt_unpack(g, v, packed, bytes, err);
    } else {
        status = open_plain_view(g, v, user, bytes, err);
    }
    if (status == STATUS_OK)
        status = gltf_whole(g, view, "byteStride", "bufferViews", v, (double)bytes->stride, (double)element, 256.0,
                            &bytes->stride, err);
    if (status == STATUS_OK)
        status = gltf_whole(g, object, "byteOffset", where, index, 0.0, 0.0, GLTF_MAX_BYTES, &offset, err);
    if (status != STATUS_OK)
        return status;
    if (offset > bytes->size)
        return error_set(err, STATUS_INPUT, "%s: %s begins behind the %zu bytes of bufferViews[%zu]", g->name, user,
                         bytes->size, v);
    bytes->data += offset;
    bytes->size -= (size_t)offset;
    return STATUS_OK;
}

enum status gltf_view(struct gltf_file *g, const cJSON *object, const char *where, size_t index,
                      struct gltf_bytes *bytes, struct error *err) {
    return open_view(g, object, where, index, 1, bytes, err);
}

/* Whether it holds `count` elements; STATUS_INPUT where not. */
static enum status check_room(const struct gltf_file *g, const struct gltf_bytes *bytes, const char *user,
                              uint64_t count, size_t element, struct error *err) {
    size_t room = bytes->size < element ? 0 : (bytes->size - element) / (size_t)bytes->stride + 1;
    if (count <= room)
        return STATUS_OK;
    return error_set(err, STATUS_INPUT, "%s: %s promises %llu elements, but its bufferView holds %zu", g->name, user,
                     (unsigned long long)count, room);
}

/* --- sparse accessors (3.6.2.3) ------------------------------------------------------------ */

/* Replaces the elements that "sparse" names. */
static enum status overlay(struct gltf_file *g, const cJSON *sparse, size_t index, struct gltf_span *span,
                           size_t element, struct error *err) {
    const cJSON *indices = cJSON_GetObjectItemCaseSensitive(sparse, "indices");
    const cJSON *values = cJSON_GetObjectItemCaseSensitive(sparse, "values");
    struct gltf_bytes at, value;
    struct gltf_span places = {0};
    uint64_t count, component;
    char user[64];
    snprintf(user, sizeof user, "accessors[%zu].sparse", index);
    enum status status =
        gltf_whole(g, sparse, "count", "sparse of accessors", index, -1.0, 1.0, (double)span->count, &count, err);
    if (status == STATUS_OK)
        status = gltf_whole(g, indices, "componentType", "sparse.indices of accessors", index, 0.0, GLTF_UBYTE,
                            GLTF_UINT, &component, err);
    size_t width = status == STATUS_OK ? component_bytes(component) : 0;
    if (status == STATUS_OK && (component == GLTF_SHORT || width == 0))
        status = error_set(err, STATUS_INPUT, "%s: the indices of %s are not unsigned integers", g->name, user);
    if (status == STATUS_OK)
        status = open_view(g, indices, "sparse.indices of accessors", index, width, &at, err);
    if (status == STATUS_OK)
        status = open_view(g, values, "sparse.values of accessors", index, element, &value, err);
    if (status == STATUS_OK)
        status = check_room(g, &at, user, count, width, err);
    if (status == STATUS_OK)
        status = check_room(g, &value, user, count, element, err);
    if (status != STATUS_OK)
        return status;
    places = (struct gltf_span){.data = at.data, .stride = at.stride, .component = (enum gltf_component)component};
    for (size_t i = 0; i < count; i++) {
        size_t place = gltf_read_index(&places, i);
        if (place >= span->count)
            return error_set(err, STATUS_INPUT, "%s: %s replaces element %zu of %zu", g->name, user, place,
                             span->count);
        memcpy(span->own + place * element, value.data + i * value.stride, element);
    }
    return STATUS_OK;
}

/* Makes a copy of the elements, or zeros where there is no view, and replaces some. */
static enum status open_sparse(struct gltf_file *g, const cJSON *sparse, size_t index, struct gltf_span *span,
                               size_t element, struct error *err) {
    if (!span->data && span->count > MAX_ZEROS)
        return error_set(err, STATUS_LIMIT, "%s: accessors[%zu] has %zu zeros, more than the limit", g->name, index,
                         span->count);
    span->own = mem_calloc(span->count, element);
    for (size_t i = 0; i < span->count && span->data; i++)
        memcpy(span->own + i * element, span->data + i * span->stride, element);
    span->data = span->own;
    span->stride = element;
    return overlay(g, sparse, index, span, element, err);
}

/* --- accessors (3.6.2) --------------------------------------------------------------------- */

enum status gltf_span(struct gltf_file *g, size_t index, const char *type, struct gltf_span *span, struct error *err) {
    const cJSON *accessor = g->accessors.item[index];
    const cJSON *sparse = cJSON_GetObjectItemCaseSensitive(accessor, "sparse");
    const char *own = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(accessor, "type"));
    struct gltf_bytes bytes;
    uint64_t component = 0, count = 0;
    char user[48];
    *span = (struct gltf_span){0};
    snprintf(user, sizeof user, "accessors[%zu]", index);
    if (!own || strcmp(own, type) != 0)
        return error_set(err, STATUS_INPUT, "%s: %s is of type %.16s, wanted is %s", g->name, user, own ? own : "none",
                         type);
    enum status status =
        gltf_whole(g, accessor, "componentType", "accessors", index, 0.0, GLTF_BYTE, GLTF_FLOAT, &component, err);
    if (status == STATUS_OK)
        status = gltf_whole(g, accessor, "count", "accessors", index, -1.0, 1.0, UINT32_MAX - 1.0, &count, err);
    size_t element = component_bytes(component) * width_of(type);
    if (status == STATUS_OK && element == 0)
        status = error_set(err, STATUS_INPUT, "%s: %s.componentType is none", g->name, user);
    if (status == STATUS_OK)
        status = open_view(g, accessor, "accessors", index, element, &bytes, err);
    if (status == STATUS_OK && !bytes.data && !sparse)
        status = error_set(err, STATUS_INPUT, "%s: %s has no bufferView", g->name, user);
    if (status == STATUS_OK && bytes.data)
        status = check_room(g, &bytes, user, count, element, err);
    if (status != STATUS_OK)
        return status;
    *span = (struct gltf_span){.data = bytes.data,
                               .count = (size_t)count,
                               .stride = (size_t)bytes.stride,
                               .component = (enum gltf_component)component,
                               .is_normalized = cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(accessor, "normalized"))};
    return sparse ? open_sparse(g, sparse, index, span, element, err) : STATUS_OK;
}

void gltf_span_release(struct gltf_span *span) {
    mem_free(span->own);
    *span = (struct gltf_span){0};
}

static double number_at(const struct gltf_span *span, const uint8_t *at) {
    float single;
    uint32_t bits;
    bool is_fraction = span->is_normalized;
    switch (span->component) {
    case GLTF_BYTE: return is_fraction ? fmax((int8_t)at[0] / 127.0, -1.0) : (int8_t)at[0];
    case GLTF_UBYTE: return is_fraction ? at[0] / 255.0 : at[0];
    case GLTF_SHORT:
    case GLTF_USHORT:
        bits = (uint32_t)at[0] | (uint32_t)at[1] << 8;
        if (span->component == GLTF_USHORT)
            return is_fraction ? bits / 65535.0 : bits;
        return is_fraction ? fmax((int16_t)bits / 32767.0, -1.0) : (int16_t)bits;
    case GLTF_UINT: return word_at(at);
    case GLTF_FLOAT: break;
    }
    bits = word_at(at);
    memcpy(&single, &bits, sizeof single);
    return (double)single;
}

void gltf_read_vector(const struct gltf_span *span, size_t at, size_t width, double *value) {
    size_t bytes = component_bytes(span->component);
    for (size_t i = 0; i < width; i++)
        value[i] = number_at(span, span->data + at * span->stride + i * bytes);
}

uint32_t gltf_read_index(const struct gltf_span *span, size_t at) {
    const uint8_t *data = span->data + at * span->stride;
    switch (component_bytes(span->component)) {
    case 1: return data[0];
    case 2: return (uint32_t)data[0] | (uint32_t)data[1] << 8;
    default: return word_at(data);
    }
}
