/* glb_view.h -- reads a .glb file back for tests: header, chunks and JSON as the glTF 2.0 specification asks for. */
#ifndef UNBAKE_TESTS_UNIT_GLB_VIEW_H
#define UNBAKE_TESTS_UNIT_GLB_VIEW_H

#include "common/buf.h"
#include "common/file.h"
#include "common/json.h"
#include "tests/check.h"

struct glb {
    struct buf file;
    cJSON *json;
    const char *bytes;
    size_t length; /* of bytes */
};

static inline uint32_t word_at(const char *at) {
    uint32_t value;
    memcpy(&value, at, sizeof value);
    return value;
}

static inline double number(const cJSON *object, const char *key) {
    return cJSON_GetNumberValue(cJSON_GetObjectItemCaseSensitive(object, key));
}

static inline const cJSON *item(const struct glb *g, const char *array, double index) {
    return cJSON_GetArrayItem(cJSON_GetObjectItemCaseSensitive(g->json, array), (int)index);
}

static inline const cJSON *member(const cJSON *object, const char *a, const char *b) {
    return cJSON_GetObjectItemCaseSensitive(cJSON_GetObjectItemCaseSensitive(object, a), b);
}

/* Header and chunks: lengths, order, padding. */
static inline void read_glb(const char *path, struct glb *g) {
    struct error err;
    buf_init(&g->file, 1 << 26);
    CHECK(file_read(path, &g->file, &err) == STATUS_OK);
    const char *data = g->file.data;
    CHECK(g->file.length > 28 && memcmp(data, "glTF", 4) == 0 && word_at(data + 4) == 2);
    CHECK(word_at(data + 8) == g->file.length && g->file.length % 4 == 0);
    uint32_t length = word_at(data + 12);
    CHECK(memcmp(data + 16, "JSON", 4) == 0 && length % 4 == 0);
    CHECK_THAT(json_parse(data + 20, length, "scene.glb", &g->json, &err) == STATUS_OK, "%s", err.message);
    const char *chunk = data + 20 + length;
    g->length = word_at(chunk);
    g->bytes = chunk + 8;
    CHECK(memcmp(chunk + 4, "BIN\0", 4) == 0);
    CHECK(g->bytes + g->length == data + g->file.length);
    CHECK(number(item(g, "buffers", 0), "byteLength") == (double)g->length);
    CHECK_STRING(cJSON_GetStringValue(member(g->json, "asset", "version")), "2.0");
}

static inline void release_glb(struct glb *g) {
    cJSON_Delete(g->json);
    buf_release(&g->file);
}

/* Image number_of is the file png, byte for byte. */
static inline void check_picture(const struct glb *g, double number_of, const char *png) {
    struct buf file;
    struct error err;
    buf_init(&file, 1 << 26);
    CHECK(file_read(png, &file, &err) == STATUS_OK);
    const cJSON *view = item(g, "bufferViews", number(item(g, "images", number_of), "bufferView"));
    size_t length = (size_t)number(view, "byteLength"), offset = (size_t)number(view, "byteOffset");
    CHECK(length == file.length && offset + length <= g->length && offset % 4 == 0);
    CHECK(memcmp(g->bytes + offset, file.data, length) == 0);
    buf_release(&file);
}

#endif
