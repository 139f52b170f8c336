/* gltf_file.c -- see gltf_file.h. Sections are those of the glTF 2.0 specification. */
#include "server/ingest/mesh/gltf_file.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "common/base64.h"
#include "common/file.h"
#include "common/mem.h"
#include "server/ingest/path.h"

#define MAX_JSON_BYTES ((size_t)64 << 20) /* the parsed tree takes about ten times as much */
#define MAGIC 0x46546c67
#define CHUNK_JSON 0x4e4f534a /* "JSON" */
#define CHUNK_BIN 0x004e4942  /* "BIN" */

static uint32_t word_at(const uint8_t *at) {
    return (uint32_t)at[0] | (uint32_t)at[1] << 8 | (uint32_t)at[2] << 16 | (uint32_t)at[3] << 24;
}

/* --- container (4.4) ------------------------------------------------------------------------ */

struct chunks {
    const uint8_t *json, *bin; /* bin: NULL where there is none */
    size_t json_size, bin_size;
};

static enum status split_glb(const uint8_t *data, size_t size, const char *name, struct chunks *c, struct error *err) {
    if (size < 20 || word_at(data + 4) != 2)
        return error_set(err, STATUS_INPUT, "%s is not a GLB of version 2", name);
    uint32_t length = word_at(data + 8);
    if (length > size)
        return error_set(err, STATUS_INPUT, "%s is cut off: its header promises %u bytes, there are %zu", name, length,
                         size);
    for (size_t at = 12, number = 0; at + 8 <= length; number++) {
        uint32_t chunk = word_at(data + at), type = word_at(data + at + 4);
        if (chunk > length - at - 8)
            return error_set(err, STATUS_INPUT, "%s: chunk %zu is longer than the file", name, number);
        if (number == 0 && type == CHUNK_JSON) {
            c->json = data + at + 8;
            c->json_size = chunk;
        } else if (number == 1 && type == CHUNK_BIN) {
            c->bin = data + at + 8;
            c->bin_size = chunk;
        }
        at += 8 + (size_t)chunk;
    }
    if (!c->json)
        return error_set(err, STATUS_INPUT, "%s: its first chunk is not JSON", name);
    return STATUS_OK;
}

/* --- buffers (3.6.1) ------------------------------------------------------------------------ */

char *gltf_unescape(const char *uri) {
    char *text = mem_strdup(uri), *to = text;
    for (const char *c = text; *c; c++) {
        unsigned value;
        if (*c == '%' && strspn(c + 1, "0123456789abcdefABCDEF") >= 2 && sscanf(c + 1, "%2x", &value) == 1 &&
            value != 0) {
            *to++ = (char)value;
            c += 2;
        } else {
            *to++ = *c;
        }
    }
    *to = '\0';
    return text;
}

static enum status open_file_buffer(struct gltf_file *g, struct gltf_buffer *b, const char *uri, struct error *err) {
    char *text = gltf_unescape(uri), *clean = NULL;
    enum status status = path_clean(text, &clean, err);
    if (status == STATUS_OK && !g->folder)
        status = error_set(err, STATUS_INPUT, "%s: its buffer %s is not in it", g->name, uri);
    if (status == STATUS_OK && !file_is_in(g->folder, clean))
        status = error_set(err, STATUS_INPUT, "%s names the buffer %s, which is not in the bundle", g->name, clean);
    if (status == STATUS_OK) {
        char *path = file_join(g->folder, clean);
        status = mapping_open(&b->file, path, clean, "a buffer", err);
        mem_free(path);
    }
    b->data = b->file.data;
    b->size = b->file.size;
    mem_free(clean);
    mem_free(text);
    return status;
}

static enum status open_buffer(struct gltf_file *g, size_t i, const struct chunks *c, struct error *err) {
    struct gltf_buffer *b = &g->buffer[i];
    const char *uri = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(g->buffers.item[i], "uri"));
    if (!uri) {
        b->data = i == 0 ? c->bin : NULL;
        b->size = b->data ? c->bin_size : 0;
        return STATUS_OK;
    }
    if (strncmp(uri, "data:", 5) != 0)
        return open_file_buffer(g, b, uri, err);
    const char *text = strstr(uri, ";base64,");
    size_t length = text ? strlen(text + 8) : 0;
    b->decoded = mem_alloc(length / 4 * 3 + 3);
    if (!text || !base64_decode(text + 8, length, b->decoded, length / 4 * 3, &b->size))
        return error_set(err, STATUS_INPUT, "%s: buffers[%zu] is a data: URI that is not base64", g->name, i);
    b->data = b->decoded;
    return STATUS_OK;
}

/* --- JSON ----------------------------------------------------------------------------------- */

static enum status make_list(const struct gltf_file *g, struct gltf_list *list, const char *key, struct error *err) {
    const cJSON *array = cJSON_GetObjectItemCaseSensitive(g->json, key), *item;
    list->key = key;
    if (!array)
        return STATUS_OK;
    if (!cJSON_IsArray(array))
        return error_set(err, STATUS_INPUT, "%s: \"%s\" must be an array", g->name, key);
    list->item = mem_array((size_t)cJSON_GetArraySize(array), sizeof(const cJSON *));
    cJSON_ArrayForEach(item, array) {
        if (!cJSON_IsObject(item))
            return error_set(err, STATUS_INPUT, "%s: %s[%zu] must be an object", g->name, key, list->count);
        list->item[list->count++] = item;
    }
    return STATUS_OK;
}

static enum status read_json(struct gltf_file *g, const struct chunks *c, struct error *err) {
    struct {
        struct gltf_list *list;
        const char *key;
    } table[] = {{&g->buffers, "buffers"}, {&g->views, "bufferViews"}, {&g->accessors, "accessors"},
                 {&g->meshes, "meshes"},   {&g->nodes, "nodes"},       {&g->scenes, "scenes"}};
    if (c->json_size > MAX_JSON_BYTES)
        return error_set(err, STATUS_LIMIT, "%s: its JSON is larger than %zu bytes", g->name, MAX_JSON_BYTES);
    enum status status = json_parse((const char *)c->json, c->json_size, g->name, &g->json, err);
    if (status != STATUS_OK)
        return status;
    const cJSON *asset = cJSON_GetObjectItemCaseSensitive(g->json, "asset");
    const char *version = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(asset, "version"));
    if (!version || strncmp(version, "2.", 2) != 0)
        return error_set(err, STATUS_INPUT, "%s is not glTF 2.0: asset.version is \"%.16s\"", g->name,
                         version ? version : "");
    for (size_t i = 0; i < sizeof table / sizeof *table && status == STATUS_OK; i++)
        status = make_list(g, table[i].list, table[i].key, err);
    return status;
}

enum status gltf_file_open(struct gltf_file *g, const void *data, size_t size, const char *name, const char *folder,
                           struct error *err) {
    struct chunks c = {.json = data, .json_size = size};
    *g = (struct gltf_file){.name = name, .folder = folder};
    enum status status = STATUS_OK;
    if (size >= 4 && word_at(data) == MAGIC) {
        c = (struct chunks){0};
        status = split_glb(data, size, name, &c, err);
    }
    if (status == STATUS_OK)
        status = read_json(g, &c, err);
    if (status != STATUS_OK)
        return status;
    g->buffer = mem_calloc(g->buffers.count + 1, sizeof *g->buffer);
    g->unpacked = mem_calloc(g->views.count + 1, sizeof *g->unpacked);
    for (size_t i = 0; i < g->buffers.count && status == STATUS_OK; i++)
        status = open_buffer(g, i, &c, err);
    return status;
}

void gltf_file_release(struct gltf_file *g) {
    struct gltf_list *lists[] = {&g->buffers, &g->views, &g->accessors, &g->meshes, &g->nodes, &g->scenes};
    for (size_t i = 0; g->buffer && i < g->buffers.count; i++) {
        mapping_close(&g->buffer[i].file);
        mem_free(g->buffer[i].decoded);
    }
    mem_free(g->buffer);
    for (size_t i = 0; g->unpacked && i < g->views.count; i++)
        mem_free(g->unpacked[i]);
    mem_free(g->unpacked);
    for (size_t i = 0; i < sizeof lists / sizeof *lists; i++)
        mem_free(lists[i]->item);
    cJSON_Delete(g->json);
    *g = (struct gltf_file){0};
}

/* --- numbers -------------------------------------------------------------------------------- */

enum status gltf_whole(const struct gltf_file *g, const cJSON *object, const char *key, const char *where, size_t index,
                       double fallback, double least, double most, uint64_t *value, struct error *err) {
    const cJSON *member = cJSON_GetObjectItemCaseSensitive(object, key);
    double number = member ? cJSON_GetNumberValue(member) : fallback;
    if (!(number >= least && number <= most) || number != floor(number))
        return error_set(err, STATUS_INPUT, "%s: %s[%zu].%s is not a whole number from %.0f to %.0f", g->name, where,
                         index, key, least, most);
    *value = (uint64_t)number;
    return STATUS_OK;
}

enum status gltf_index(const struct gltf_file *g, const cJSON *object, const char *key, const char *where,
                       const struct gltf_list *list, bool *found, size_t *index, struct error *err) {
    const cJSON *member = cJSON_GetObjectItemCaseSensitive(object, key);
    double number = cJSON_GetNumberValue(member);
    *found = member != NULL;
    *index = 0;
    if (!member)
        return STATUS_OK;
    if (!(number >= 0.0 && number < (double)list->count) || number != floor(number))
        return error_set(err, STATUS_INPUT, "%s: %s.%s is none of the %zu %s", g->name, where, key, list->count,
                         list->key);
    *index = (size_t)number;
    return STATUS_OK;
}

const cJSON *gltf_extension(const cJSON *object, const char *extension) {
    const cJSON *extensions = cJSON_GetObjectItemCaseSensitive(object, "extensions");
    return cJSON_GetObjectItemCaseSensitive(extensions, extension);
}

enum status gltf_buffer_part(const struct gltf_file *g, const cJSON *object, const char *where, size_t view,
                             double least, size_t *buffer, uint64_t *offset, uint64_t *length, struct error *err) {
    static const char list[] = "bufferViews";
    bool found;
    enum status status = gltf_index(g, object, "buffer", where, &g->buffers, &found, buffer, err);
    if (status == STATUS_OK && !found)
        status = error_set(err, STATUS_INPUT, "%s: %s has no buffer", g->name, where);
    if (status == STATUS_OK)
        status = gltf_whole(g, object, "byteOffset", list, view, 0.0, 0.0, GLTF_MAX_BYTES, offset, err);
    if (status == STATUS_OK)
        status = gltf_whole(g, object, "byteLength", list, view, -1.0, least, GLTF_MAX_BYTES, length, err);
    return status;
}
