/* gltf_materials.c -- see gltf_materials.h. */
#include "server/ingest/mesh/gltf_materials.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "common/base64.h"
#include "common/mem.h"
#include "server/ingest/mesh/gltf_accessor.h"

enum { CLAMP_TO_EDGE = 33071, MIRRORED_REPEAT = 33648 };

/* Where a material names its pictures. */
static const struct slot {
    const char *object, *key; /* object NULL: the material itself */
    enum material_quantity quantity[2];
    int count, channel[2];
    bool is_color;
} slots[] = {
    {"pbrMetallicRoughness", "baseColorTexture", {MATERIAL_BASE_COLOR}, 1, {-1}, true},
    {"pbrMetallicRoughness", "metallicRoughnessTexture", {MATERIAL_ROUGHNESS, MATERIAL_METALLIC}, 2, {1, 2}, false},
    {NULL, "emissiveTexture", {MATERIAL_EMISSION}, 1, {-1}, true},
};
#define SLOT_COUNT (sizeof slots / sizeof *slots)

static const cJSON *member(const cJSON *object, const char *key) {
    return cJSON_GetObjectItemCaseSensitive(object, key);
}

static const cJSON *item_at(const struct gltf_file *g, const char *list, const cJSON *index) {
    double number = cJSON_IsNumber(index) ? index->valuedouble : -1.0;
    return number >= 0.0 && number < 1e6 ? cJSON_GetArrayItem(member(g->json, list), (int)number) : NULL;
}

static double number_or(const cJSON *object, const char *key, double fallback) {
    const cJSON *value = member(object, key);
    return cJSON_IsNumber(value) && isfinite(value->valuedouble) ? value->valuedouble : fallback;
}

static rgb color_or(const cJSON *object, const char *key, rgb fallback) {
    const cJSON *value = member(object, key);
    double v[3];
    if (cJSON_GetArraySize(value) < 3)
        return fallback;
    for (int i = 0; i < 3; i++) {
        v[i] = cJSON_GetNumberValue(cJSON_GetArrayItem(value, i));
        if (!(v[i] >= 0.0) || !isfinite(v[i]))
            return fallback;
    }
    return rgb_make((float)v[0], (float)v[1], (float)v[2]);
}

static float share(double value) { return (float)fmin(fmax(value, 0.0), 1.0); }

static rgb clamp_color(rgb c) { return rgb_make(share((double)c.r), share((double)c.g), share((double)c.b)); }

/* --- pictures ------------------------------------------------------------------------------------- */

static const cJSON *texture_of(const cJSON *material, const struct slot *s) {
    return member(s->object ? member(material, s->object) : material, s->key);
}

/* The image of a texture: as the extensions for other formats name it, else its source. */
static const cJSON *source_of(const cJSON *texture) {
    static const char *const formats[] = {"EXT_texture_webp", "EXT_texture_avif"};
    for (size_t i = 0; i < sizeof formats / sizeof *formats; i++) {
        const cJSON *source = member(gltf_extension(texture, formats[i]), "source");
        if (source)
            return source;
    }
    return member(texture, "source");
}

static void set_wrap(const struct gltf_file *g, const cJSON *texture, struct material_map *map) {
    static const char *const key[2] = {"wrapS", "wrapT"};
    const cJSON *sampler = item_at(g, "samplers", member(texture, "sampler"));
    for (int i = 0; i < 2; i++) {
        double how = number_or(sampler, key[i], 0.0);
        map->wrap[i] = how == (double)CLAMP_TO_EDGE     ? MATERIAL_WRAP_CLAMP
                       : how == (double)MIRRORED_REPEAT ? MATERIAL_WRAP_MIRROR
                                                        : MATERIAL_WRAP_REPEAT;
    }
}

/* KHR_texture_transform: translation times rotation times scale, of (u, v). */
static void set_transform(const cJSON *use, struct material_map *map) {
    const cJSON *t = gltf_extension(use, "KHR_texture_transform");
    const cJSON *offset = member(t, "offset"), *scale = member(t, "scale");
    double turn = number_or(t, "rotation", 0.0), c = cos(turn), s = sin(turn), move[2] = {0.0, 0.0},
           size[2] = {1.0, 1.0};
    for (int i = 0; i < 2; i++) {
        if (cJSON_GetArraySize(offset) == 2)
            move[i] = cJSON_GetNumberValue(cJSON_GetArrayItem(offset, i));
        if (cJSON_GetArraySize(scale) == 2)
            size[i] = cJSON_GetNumberValue(cJSON_GetArrayItem(scale, i));
    }
    const double m[2][3] = {{c * size[0], s * size[1], move[0]}, {-s * size[0], c * size[1], move[1]}};
    for (int i = 0; i < 2; i++)
        for (int k = 0; k < 3; k++)
            map->turn[i][k] = (float)m[i][k];
}

static enum status read_data_uri(const struct gltf_file *g, struct mesh_materials *materials, const char *name,
                                 const char *uri, bool is_color, size_t *number, struct error *err) {
    const char *text = strstr(uri, ";base64,");
    size_t length = text ? strlen(text + 8) : 0, size = 0;
    uint8_t *bytes = mem_alloc(length / 4 * 3 + 3);
    enum status status = STATUS_OK;
    if (!text || !base64_decode(text + 8, length, bytes, length / 4 * 3, &size))
        status = error_set(err, STATUS_INPUT, "%s: %s is a data: URI that is not base64", g->name, name);
    if (status == STATUS_OK)
        status = mesh_materials_read_bytes(materials, name, bytes, size, is_color, number, err);
    mem_free(bytes);
    return status;
}

static enum status read_image(struct gltf_file *g, size_t index, bool is_color, struct mesh_materials *materials,
                              size_t *number, struct error *err) {
    const cJSON *image = cJSON_GetArrayItem(member(g->json, "images"), (int)index);
    const char *uri = cJSON_GetStringValue(member(image, "uri"));
    struct gltf_bytes bytes;
    char name[48];
    snprintf(name, sizeof name, "images[%zu]", index);
    if (uri && strncmp(uri, "data:", 5) == 0)
        return read_data_uri(g, materials, name, uri, is_color, number, err);
    if (uri) {
        char *path = gltf_unescape(uri);
        enum status status = mesh_materials_read_image(materials, g->folder, g->name, path, is_color, number, err);
        mem_free(path);
        return status;
    }
    enum status status = gltf_view(g, image, "images", index, &bytes, err);
    if (status == STATUS_OK && !bytes.data)
        status = error_set(err, STATUS_INPUT, "%s: %s has neither a uri nor a bufferView", g->name, name);
    return status == STATUS_OK
               ? mesh_materials_read_bytes(materials, name, bytes.data, bytes.size, is_color, number, err)
               : status;
}

static enum status read_slot(struct gltf_file *g, const cJSON *material, const struct slot *s,
                             struct mesh_materials *materials, struct mesh_material *m, struct error *err) {
    const cJSON *use = texture_of(material, s), *texture = item_at(g, "textures", member(use, "index"));
    struct material_map map = {.is_there = true};
    if (!use)
        return STATUS_OK;
    const cJSON *source = source_of(texture);
    if (!item_at(g, "images", source))
        return error_set(err, STATUS_INPUT,
                         "%s: the %s of material \"%s\" has no picture that is read (PNG, JPEG, WebP, AVIF)", g->name,
                         s->key, m->name);
    enum status status = read_image(g, (size_t)source->valuedouble, s->is_color, materials, &map.image, err);
    if (status != STATUS_OK)
        return status;
    set_wrap(g, texture, &map);
    set_transform(use, &map);
    for (int i = 0; i < s->count; i++) {
        map.channel = s->channel[i];
        m->map[s->quantity[i]] = map;
    }
    return STATUS_OK;
}

/* --- materials ------------------------------------------------------------------------------------ */

static void leave_out(const cJSON *material, struct mesh_materials *materials) {
    static const char *const read[] = {"KHR_materials_emissive_strength", "KHR_materials_ior",
                                       "KHR_materials_specular"};
    const char *alpha = cJSON_GetStringValue(member(material, "alphaMode"));
    if (member(material, "normalTexture"))
        mesh_materials_leave_out(materials, "normal maps");
    if (alpha && strcmp(alpha, "OPAQUE") != 0)
        mesh_materials_leave_out(materials, "transparency");
    if (cJSON_IsTrue(member(material, "doubleSided")) &&
        !rgb_is_black(color_or(material, "emissiveFactor", rgb_gray(0.0f))))
        mesh_materials_leave_out(materials, "light of back sides");
    const cJSON *specular = gltf_extension(material, "KHR_materials_specular");
    if (member(specular, "specularTexture") || member(specular, "specularColorTexture") ||
        member(specular, "specularColorFactor"))
        mesh_materials_leave_out(materials, "textures and colour of specular");
    const cJSON *extensions = member(material, "extensions");
    for (const cJSON *e = extensions ? extensions->child : NULL; e; e = e->next) {
        bool is_read = false;
        for (size_t i = 0; i < sizeof read / sizeof *read; i++)
            is_read = is_read || strcmp(e->string, read[i]) == 0;
        if (!is_read)
            mesh_materials_leave_out(materials, e->string);
    }
}

static void read_factors(const cJSON *material, struct mesh_material *m) {
    const cJSON *model = member(material, "pbrMetallicRoughness");
    double ior = number_or(gltf_extension(material, "KHR_materials_ior"), "ior", 1.5);
    double factor = number_or(gltf_extension(material, "KHR_materials_specular"), "specularFactor", 1.0);
    double strength = number_or(gltf_extension(material, "KHR_materials_emissive_strength"), "emissiveStrength", 1.0);
    double root = (ior - 1.0) / (ior + 1.0);
    m->is_own = true;
    m->base_color = clamp_color(color_or(model, "baseColorFactor", rgb_gray(1.0f)));
    m->roughness = share(number_or(model, "roughnessFactor", 1.0));
    m->metallic = share(number_or(model, "metallicFactor", 1.0));
    m->specular = share((double)mesh_material_specular((float)(root * root * factor)));
    m->emission = rgb_scale(color_or(material, "emissiveFactor", rgb_gray(0.0f)), (float)fmax(strength, 0.0));
}

static enum status read_material(struct gltf_file *g, const cJSON *material, bool is_used,
                                 struct mesh_materials *materials, struct error *err) {
    const char *name = cJSON_GetStringValue(member(material, "name"));
    size_t number = materials->material_count;
    enum status status = STATUS_OK;
    read_factors(material, mesh_materials_add(materials, name ? name : ""));
    if (!is_used)
        return STATUS_OK;
    leave_out(material, materials);
    if (gltf_extension(material, "KHR_materials_pbrSpecularGlossiness") && !member(material, "pbrMetallicRoughness")) {
        error_set(err, STATUS_INPUT, "%s: material \"%s\" is of KHR_materials_pbrSpecularGlossiness, which is not read",
                  g->name, materials->material[number].name);
        return error_hint(err, "convert it to metal and roughness: gltf-transform metalrough IN.glb OUT.glb");
    }
    for (size_t i = 0; i < SLOT_COUNT && status == STATUS_OK; i++)
        status = read_slot(g, material, &slots[i], materials, &materials->material[number], err);
    return status;
}

size_t gltf_materials_count(const struct gltf_file *g) {
    return (size_t)cJSON_GetArraySize(member(g->json, "materials"));
}

enum status gltf_materials_read(struct gltf_file *g, const bool *is_used, struct mesh_materials *materials,
                                struct error *err) {
    const cJSON *material;
    size_t i = 0;
    enum status status = STATUS_OK;
    cJSON_ArrayForEach(material, member(g->json, "materials")) {
        status = read_material(g, material, is_used && is_used[i], materials, err);
        i++;
        if (status != STATUS_OK)
            return status;
    }
    mesh_materials_add(materials, "");
    return STATUS_OK;
}

enum status gltf_materials_uv_set(const struct gltf_file *g, size_t material, int *set, struct error *err) {
    const cJSON *object = cJSON_GetArrayItem(member(g->json, "materials"), (int)material);
    *set = -1;
    for (size_t i = 0; i < SLOT_COUNT; i++) {
        const cJSON *use = texture_of(object, &slots[i]);
        if (!use)
            continue;
        double own = number_or(use, "texCoord", 0.0);
        own = number_or(gltf_extension(use, "KHR_texture_transform"), "texCoord", own);
        if (!(own >= 0.0 && own < 16.0) || (*set >= 0 && own != (double)*set))
            return error_set(err, STATUS_INPUT,
                             "%s: the pictures of materials[%zu] use several sets of texture coordinates, "
                             "which is not read",
                             g->name, material);
        *set = (int)own;
    }
    return STATUS_OK;
}
