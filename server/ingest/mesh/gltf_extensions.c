/* gltf_extensions.c -- see gltf_extensions.h. Names are as Khronos lists them (glTF, extensions/README.md). */
#include "server/ingest/mesh/gltf_extensions.h"

#include <stddef.h>
#include <string.h>

#define BY_BLENDER                                                                                                     \
    "unpack it: blender -b --python-expr \"import bpy; bpy.ops.wm.read_homefile(use_empty=True); "                     \
    "bpy.ops.import_scene.gltf(filepath='IN.glb'); bpy.ops.export_scene.gltf(filepath='OUT.glb')\""
#define WITHOUT_IT "export it without this extension"

enum effect { EXTENSION_READ, EXTENSION_HARMLESS, EXTENSION_REFUSED };

static const struct extension_rule {
    const char *start; /* of the name */
    enum effect effect;
    const char *hint; /* how to do without one that is refused */
} rules[] = {
    {"KHR_mesh_quantization", EXTENSION_READ, NULL},
    {"EXT_meshopt_compression", EXTENSION_READ, NULL},
    {"KHR_meshopt_compression", EXTENSION_READ, NULL},
    {"EXT_mesh_gpu_instancing", EXTENSION_READ, NULL},
    {"KHR_node_visibility", EXTENSION_READ, NULL},
    {"KHR_draco_mesh_compression", EXTENSION_REFUSED, BY_BLENDER},
    {"KHR_gaussian_splatting", EXTENSION_REFUSED, "a mesh is needed, not Gaussians"},
    {"EXT_primitive_voxels", EXTENSION_REFUSED, "a mesh is needed, not voxels"},
    {"CESIUM_RTC", EXTENSION_REFUSED, "write the centre as a node's translation"},
    {"MPEG_", EXTENSION_REFUSED, WITHOUT_IT},
    {"KHR_materials_", EXTENSION_HARMLESS, NULL},
    {"KHR_texture_", EXTENSION_HARMLESS, NULL},
    {"EXT_texture_", EXTENSION_HARMLESS, NULL},
    {"MSFT_texture_", EXTENSION_HARMLESS, NULL},
    {"MSFT_packing_", EXTENSION_HARMLESS, NULL},
    {"KHR_techniques_", EXTENSION_HARMLESS, NULL},
    {"KHR_lights_", EXTENSION_HARMLESS, NULL},
    {"EXT_lights_", EXTENSION_HARMLESS, NULL},
    {"KHR_animation_", EXTENSION_HARMLESS, NULL},
    {"KHR_xmp", EXTENSION_HARMLESS, NULL},
    {"KHR_audio", EXTENSION_HARMLESS, NULL},
    {"EXT_structural_metadata", EXTENSION_HARMLESS, NULL},
    {"EXT_mesh_features", EXTENSION_HARMLESS, NULL},
    {"EXT_instance_features", EXTENSION_HARMLESS, NULL},
    {"CESIUM_primitive_outline", EXTENSION_HARMLESS, NULL},
    {"MSFT_lod", EXTENSION_HARMLESS, NULL}, /* the finest level is the node itself */
};

static const struct extension_rule *rule_of(const char *name) {
    for (size_t i = 0; i < sizeof rules / sizeof *rules; i++)
        if (strncmp(name, rules[i].start, strlen(rules[i].start)) == 0)
            return &rules[i];
    return NULL;
}

static enum status refuse(const struct gltf_file *g, const char *verb, const char *name, const char *hint,
                          struct error *err) {
    error_set(err, STATUS_INPUT, "%s %s the extension %.64s, which is not read", g->name, verb, name);
    return error_hint(err, "%s", hint);
}

enum status gltf_extensions_check(const struct gltf_file *g, struct error *err) {
    const cJSON *item;
    cJSON_ArrayForEach(item, cJSON_GetObjectItemCaseSensitive(g->json, "extensionsRequired")) {
        const struct extension_rule *rule = cJSON_IsString(item) ? rule_of(item->valuestring) : NULL;
        const char *name = cJSON_IsString(item) ? item->valuestring : "(not a name)";
        if (!rule || rule->effect == EXTENSION_REFUSED)
            return refuse(g, "requires", name, rule ? rule->hint : WITHOUT_IT, err);
    }
    cJSON_ArrayForEach(item, cJSON_GetObjectItemCaseSensitive(g->json, "extensionsUsed")) {
        const struct extension_rule *rule = cJSON_IsString(item) ? rule_of(item->valuestring) : NULL;
        if (rule && rule->effect == EXTENSION_REFUSED)
            return refuse(g, "uses", item->valuestring, rule->hint, err);
    }
    return STATUS_OK;
}

const char *gltf_extensions_unknown(const struct gltf_file *g) {
    const cJSON *item;
    cJSON_ArrayForEach(item, cJSON_GetObjectItemCaseSensitive(g->json, "extensionsUsed"))
        if (cJSON_IsString(item) && !rule_of(item->valuestring))
            return item->valuestring;
    return NULL;
}
