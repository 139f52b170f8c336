/* gltf_uv.c -- see gltf_uv.h. */
#include "server/ingest/mesh/gltf_uv.h"

#include <math.h>
#include <stdio.h>

#define MAX_SET 31.0 /* of TEXCOORD_n */

static const cJSON *item_of(const struct gltf_file *g, const char *list, const cJSON *number) {
    const cJSON *array = cJSON_GetObjectItemCaseSensitive(g->json, list);
    double index = cJSON_GetNumberValue(number); /* NaN: none */
    return index >= 0.0 && index < 1e6 ? cJSON_GetArrayItem(array, (int)index) : NULL;
}

/* The use of a texture as base colour, textureInfo; NULL: none. */
static const cJSON *use_of(const struct gltf_file *g, const cJSON *primitive) {
    const cJSON *material = item_of(g, "materials", cJSON_GetObjectItemCaseSensitive(primitive, "material"));
    const cJSON *model = cJSON_GetObjectItemCaseSensitive(material, "pbrMetallicRoughness");
    return cJSON_GetObjectItemCaseSensitive(model, "baseColorTexture");
}

int gltf_uv_picture(const struct gltf_file *g, const cJSON *primitive) {
    const cJSON *index = cJSON_GetObjectItemCaseSensitive(use_of(g, primitive), "index");
    const cJSON *source = cJSON_GetObjectItemCaseSensitive(item_of(g, "textures", index), "source");
    return item_of(g, "images", source) ? (int)cJSON_GetNumberValue(source) : -1;
}

static double number_or(const cJSON *item, double fallback) {
    return cJSON_IsNumber(item) ? item->valuedouble : fallback;
}

/* Offset, rotation and scale, applied in the reverse order. */
static void read_transform(const cJSON *extension, double transform[2][3]) {
    const cJSON *offset = cJSON_GetObjectItemCaseSensitive(extension, "offset");
    const cJSON *scale = cJSON_GetObjectItemCaseSensitive(extension, "scale");
    double angle = number_or(cJSON_GetObjectItemCaseSensitive(extension, "rotation"), 0.0);
    double sx = number_or(cJSON_GetArrayItem(scale, 0), 1.0), sy = number_or(cJSON_GetArrayItem(scale, 1), 1.0);
    transform[0][0] = cos(angle) * sx;
    transform[0][1] = sin(angle) * sy;
    transform[0][2] = number_or(cJSON_GetArrayItem(offset, 0), 0.0);
    transform[1][0] = -sin(angle) * sx;
    transform[1][1] = cos(angle) * sy;
    transform[1][2] = number_or(cJSON_GetArrayItem(offset, 1), 0.0);
}

enum status gltf_uv_open(struct gltf_uv *uv, struct gltf_file *g, const cJSON *primitive, const char *where,
                         size_t vertex_count, struct error *err) {
    const cJSON *use = use_of(g, primitive), *extension = gltf_extension(use, "KHR_texture_transform");
    double set = number_or(cJSON_GetObjectItemCaseSensitive(use, "texCoord"), 0.0);
    set = number_or(cJSON_GetObjectItemCaseSensitive(extension, "texCoord"), set);
    enum status status = gltf_uv_open_set(uv, g, primitive, set, where, vertex_count, err);
    read_transform(extension, uv->transform);
    return status;
}

enum status gltf_uv_open_set(struct gltf_uv *uv, struct gltf_file *g, const cJSON *primitive, double set,
                             const char *where, size_t vertex_count, struct error *err) {
    char key[32];
    size_t accessor;
    *uv = (struct gltf_uv){0};
    read_transform(NULL, uv->transform);
    snprintf(key, sizeof key, "TEXCOORD_%d", set >= 0.0 && set <= MAX_SET ? (int)set : 0);
    enum status status = gltf_index(g, cJSON_GetObjectItemCaseSensitive(primitive, "attributes"), key, where,
                                    &g->accessors, &uv->is_there, &accessor, err);
    if (status == STATUS_OK && uv->is_there)
        status = gltf_span(g, accessor, "VEC2", &uv->span, err);
    if (status == STATUS_OK && uv->is_there && uv->span.count != vertex_count)
        status = error_set(err, STATUS_INPUT, "%s: %s has %zu positions and %zu texture coordinates", g->name, where,
                           vertex_count, uv->span.count);
    if (status != STATUS_OK)
        gltf_uv_release(uv);
    return status;
}

void gltf_uv_release(struct gltf_uv *uv) {
    gltf_span_release(&uv->span);
    uv->is_there = false;
}

vec2 gltf_uv_read(const struct gltf_uv *uv, size_t vertex) {
    double v[2];
    gltf_read_vector(&uv->span, vertex, 2, v);
    double x = uv->transform[0][0] * v[0] + uv->transform[0][1] * v[1] + uv->transform[0][2];
    double y = uv->transform[1][0] * v[0] + uv->transform[1][1] * v[1] + uv->transform[1][2];
    return (vec2){(float)x, (float)(1.0 - y)};
}
