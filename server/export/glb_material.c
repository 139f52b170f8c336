/* glb_material.c -- see glb_material.h. */
#include "server/export/glb_material.h"

#include <math.h>

static void add_emission(cJSON *material, cJSON *extensions, rgb emission) {
    float strength = rgb_max(emission);
    rgb factor = rgb_scale(emission, 1.0f / strength);
    const float parts[3] = {fminf(factor.r, 1.0f), fminf(factor.g, 1.0f), fminf(factor.b, 1.0f)};
    json_add(material, "emissiveFactor", cJSON_CreateFloatArray(parts, 3));
    json_add_number(cJSON_AddObjectToObject(extensions, "KHR_materials_emissive_strength"), "emissiveStrength",
                    (double)strength);
}

static void add_texture(const struct glb_look *look, cJSON *parent, const char *key, int number) {
    cJSON *use = cJSON_AddObjectToObject(parent, key);
    json_add_int(use, "index", number);
    if (look->has_input_uv)
        json_add_int(use, "texCoord", 1);
}

cJSON *glb_material(const struct glb_look *look, uint32_t s, cJSON *material) {
    const struct materials *m = look->materials;
    bool varies = look->scales && look->scales[s] > 0.0f, emits = rgb_max(m->emission[s]) > 0.0f;
    cJSON *model = cJSON_AddObjectToObject(material, "pbrMetallicRoughness");
    add_texture(look, model, "baseColorTexture", 0);
    json_add_number(model, "metallicFactor", 0.0);
    json_add_number(model, "roughnessFactor", (double)m->roughness[s]);
    json_add_bool(material, "doubleSided", !emits);
    cJSON *extensions = cJSON_AddObjectToObject(material, "extensions");
    double root = sqrt(0.08 * (double)m->specular[s]);
    json_add_number(cJSON_AddObjectToObject(extensions, "KHR_materials_specular"), "specularFactor",
                    root > 0.0 ? 1.0 : 0.0);
    json_add_number(cJSON_AddObjectToObject(extensions, "KHR_materials_ior"), "ior", (1.0 + root) / (1.0 - root));
    if (emits)
        add_emission(material, extensions,
                     rgb_scale(varies ? rgb_gray(look->scales[s]) : m->emission[s], (float)look->unit));
    if (varies)
        add_texture(look, material, "emissiveTexture", 1);
    json_add_number(cJSON_AddObjectToObject(material, "extras"), "specular", (double)m->specular[s]);
    return material;
}
