/* glb.c -- see glb.h. The container is that of the glTF 2.0 specification, section 4: a header, a
 * chunk of JSON, a chunk of bytes, each padded to four bytes. The bytes: positions, normals, texture
 * coordinates and indices of all parts, one after the other, then the pictures. */
#include "server/export/glb.h"

#include <errno.h>
#include <math.h>
#include <string.h>
#include <sys/stat.h>

#include "common/json.h"
#include "common/mem.h"
#include "common/output_names.h"
#include "common/protocol.h"
#include "server/export/emission_texture.h"
#include "server/export/glb_lights.h"
#include "server/export/glb_material.h"
#include "server/export/sink.h"
#include "server/export/upright.h"

#define MAGIC 0x46546c67 /* "glTF" */
#define CHUNK_JSON 0x4e4f534a
#define CHUNK_BIN 0x004e4942
#define HEAD_BYTES 12 /* of the file, and of each chunk */
#define CHUNK_HEAD_BYTES 8

#define TYPE_FLOAT 5126 /* component types, buffer targets, filters and wraps as glTF 2.0 numbers them */
#define TYPE_UINT 5125
#define TARGET_VERTICES 34962
#define TARGET_INDICES 34963
#define FILTER_LINEAR 9729
#define FILTER_MIPMAP 9987 /* linear, between mipmaps too */
#define WRAP_CLAMP 33071

#define CAMERAS_MAX 100 /* of held-out views */
#define NEAR_M 0.01     /* near plane of cameras, metres: nearer than any photograph is taken */

/* Buffer views, in order. Without normals there is no NORMAL, without texture coordinates of the input no INPUT_UV,
 * without emission patterns no EMISSION. */
enum buffer_view {
    VIEW_POSITION,
    VIEW_NORMAL,
    VIEW_UV,
    VIEW_INPUT_UV,
    VIEW_INDEX,
    VIEW_BASE_COLOR,
    VIEW_EMISSION,
    VIEW_COUNT
};

struct glb {
    const struct export_input *in;
    const struct parts *parts;
    const struct export_input *shown; /* whose textures it has: the atlas's or those in the input's layout */
    struct glb_look look;
    struct {
        uint64_t offset, length;
        int number;
    } view[VIEW_COUNT];
    uint64_t length; /* of the bytes, padding included */
    cJSON *root, *accessors, *nodes, *children;
    int accessor_count, node_count;
};

static uint64_t padded(uint64_t length) { return (length + 3) / 4 * 4; }

static void lay_out(struct glb *g, uint64_t base_color_bytes, uint64_t emission_bytes) {
    uint64_t vertices = g->parts->seams.vertex_count;
    const uint64_t length[VIEW_COUNT] = {
        [VIEW_POSITION] = 12 * vertices,
        [VIEW_NORMAL] = g->in->mesh->normal ? 12 * vertices : 0,
        [VIEW_UV] = 8 * vertices,
        [VIEW_INPUT_UV] = g->in->mesh->uv ? 8 * vertices : 0,
        [VIEW_INDEX] = 12 * (uint64_t)g->in->mesh->triangle_count,
        [VIEW_BASE_COLOR] = base_color_bytes,
        [VIEW_EMISSION] = emission_bytes,
    };
    int number = 0;
    for (int v = 0; v < VIEW_COUNT; v++) {
        g->view[v].offset = g->length;
        g->view[v].length = length[v];
        g->view[v].number = number;
        g->length += padded(length[v]);
        number += length[v] > 0;
    }
}

/* --- JSON ----------------------------------------------------------------------------------- */

static cJSON *add_object(cJSON *parent, const char *key) { return cJSON_AddObjectToObject(parent, key); }

static cJSON *append(cJSON *array) {
    cJSON *object = cJSON_CreateObject();
    cJSON_AddItemToArray(array, object);
    return object;
}

static void add_numbers(cJSON *object, const char *key, const float *value, int count) {
    json_add(object, key, cJSON_CreateFloatArray(value, count));
}

static void add_views(struct glb *g) {
    cJSON *views = cJSON_AddArrayToObject(g->root, "bufferViews");
    for (int v = 0; v < VIEW_COUNT; v++) {
        if (g->view[v].length == 0)
            continue;
        cJSON *view = append(views);
        json_add_int(view, "buffer", 0);
        json_add_int(view, "byteOffset", (int64_t)g->view[v].offset);
        json_add_int(view, "byteLength", (int64_t)g->view[v].length);
        if (v < VIEW_INDEX)
            json_add_int(view, "byteStride",
                         v == VIEW_UV || v == VIEW_INPUT_UV ? 8 : 12); /* shared by several accessors */
        if (v < VIEW_BASE_COLOR)
            json_add_int(view, "target", v == VIEW_INDEX ? TARGET_INDICES : TARGET_VERTICES);
    }
}

/* A texture of the same number as its image. */
static void add_picture(cJSON *images, cJSON *textures, const char *name, int view) {
    cJSON *image = append(images), *texture = append(textures);
    json_add_string(image, "name", name);
    json_add_string(image, "mimeType", "image/png");
    json_add_int(image, "bufferView", view);
    json_add_int(texture, "sampler", 0);
    json_add_int(texture, "source", cJSON_GetArraySize(images) - 1);
}

static void add_pictures(struct glb *g) {
    cJSON *images = cJSON_AddArrayToObject(g->root, "images");
    cJSON *sampler = append(cJSON_AddArrayToObject(g->root, "samplers"));
    json_add_int(sampler, "magFilter", FILTER_LINEAR);
    json_add_int(sampler, "minFilter", FILTER_MIPMAP);
    json_add_int(sampler, "wrapS", WRAP_CLAMP);
    json_add_int(sampler, "wrapT", WRAP_CLAMP);
    cJSON *textures = cJSON_AddArrayToObject(g->root, "textures");
    add_picture(images, textures, "base_color", g->view[VIEW_BASE_COLOR].number);
    if (g->look.scales)
        add_picture(images, textures, "emission", g->view[VIEW_EMISSION].number);
    cJSON *extras = add_object(sampler, "extras");
    if (!g->look.has_input_uv) /* of the input's layout nobody knows */
        json_add_int(extras, "clean_mip_level", atlas_clean_level(g->in->atlas->padding));
    json_add_number(extras, "atlas_utilisation", g->shown->atlas->utilisation);
}

/* Returns its index. */
static int add_accessor(struct glb *g, enum buffer_view view, size_t first, size_t count, const char *type,
                        int64_t stride, const struct part *bounds) {
    cJSON *accessor = append(g->accessors);
    json_add_int(accessor, "bufferView", g->view[view].number);
    json_add_int(accessor, "byteOffset", (int64_t)first * stride);
    json_add_int(accessor, "componentType", view == VIEW_INDEX ? TYPE_UINT : TYPE_FLOAT);
    json_add_int(accessor, "count", (int64_t)count);
    json_add_string(accessor, "type", type);
    if (bounds) {
        add_numbers(accessor, "min", (float[]){bounds->lower.x, bounds->lower.y, bounds->lower.z}, 3);
        add_numbers(accessor, "max", (float[]){bounds->upper.x, bounds->upper.y, bounds->upper.z}, 3);
    }
    return g->accessor_count++;
}

static void add_mesh(struct glb *g, cJSON *mesh, size_t i, const char *name) {
    const struct part *part = &g->parts->part[i];
    json_add_string(mesh, "name", name);
    cJSON *primitive = append(cJSON_AddArrayToObject(mesh, "primitives"));
    cJSON *attributes = add_object(primitive, "attributes");
    size_t first = part->first_vertex, count = part->vertex_count;
    json_add_int(attributes, "POSITION", add_accessor(g, VIEW_POSITION, first, count, "VEC3", 12, part));
    if (g->in->mesh->normal)
        json_add_int(attributes, "NORMAL", add_accessor(g, VIEW_NORMAL, first, count, "VEC3", 12, NULL));
    json_add_int(attributes, "TEXCOORD_0", add_accessor(g, VIEW_UV, first, count, "VEC2", 8, NULL));
    if (g->in->mesh->uv)
        json_add_int(attributes, "TEXCOORD_1", add_accessor(g, VIEW_INPUT_UV, first, count, "VEC2", 8, NULL));
    json_add_int(primitive, "indices",
                 add_accessor(g, VIEW_INDEX, 3 * part->first_triangle, 3 * part->triangle_count, "SCALAR", 4, NULL));
    json_add_int(primitive, "material", (int64_t)i);
}

static cJSON *add_node(struct glb *g, const char *name) {
    cJSON_AddItemToArray(g->children, cJSON_CreateNumber(g->node_count++));
    cJSON *node = append(g->nodes);
    json_add_string(node, "name", name);
    return node;
}

static void add_parts(struct glb *g) {
    cJSON *meshes = cJSON_AddArrayToObject(g->root, "meshes");
    cJSON *materials = cJSON_AddArrayToObject(g->root, "materials");
    for (size_t i = 0; i < g->parts->count; i++) {
        uint32_t s = g->parts->part[i].segment;
        char number[32];
        const char *own = segments_name(g->in->segments, g->in->mesh, s), *name = own ? own : number;
        snprintf(number, sizeof number, "segment %u", s);
        add_mesh(g, append(meshes), i, name);
        json_add_string(glb_material(&g->look, s, append(materials)), "name", name);
        cJSON *node = add_node(g, name);
        json_add_int(node, "mesh", (int64_t)i);
        cJSON *extras = add_object(node, "extras");
        json_add_int(extras, "segment", s);
        json_add_int(extras, "object_id", g->in->segments->id[s]);
    }
}

static void add_camera(struct glb *g, cJSON *cameras, const struct export_comparison *view) {
    const struct camera *c = view->camera;
    const float(*r)[3] = c->world_from_camera.rotation;
    vec3 at = c->world_from_camera.translation;
    cJSON *node = add_node(g, view->name);
    /* Our camera: x right, y down, z forward; glTF's: x right, y up, z back. Column-major. */
    add_numbers(node, "matrix",
                (float[]){r[0][0], r[1][0], r[2][0], 0.0f, -r[0][1], -r[1][1], -r[2][1], 0.0f, -r[0][2], -r[1][2],
                          -r[2][2], 0.0f, at.x, at.y, at.z, 1.0f},
                16);
    json_add_int(node, "camera", cJSON_GetArraySize(cameras));
    cJSON *camera = append(cameras);
    json_add_string(camera, "name", view->name);
    json_add_string(camera, "type", "perspective");
    cJSON *lens = add_object(camera, "perspective");
    json_add_number(lens, "aspectRatio", ((double)c->width / (double)c->fx) / ((double)c->height / (double)c->fy));
    json_add_number(lens, "yfov", 2.0 * atan(0.5 * (double)c->height / (double)c->fy));
    json_add_number(lens, "znear", NEAR_M);
}

/* glTF does not allow empty arrays. */
static void add_cameras(struct glb *g) {
    cJSON *cameras = cJSON_CreateArray();
    for (size_t i = 0; i < g->in->comparison_count && i < CAMERAS_MAX; i++)
        if (g->in->comparison[i].camera->model == CAMERA_OPENCV)
            add_camera(g, cameras, &g->in->comparison[i]);
    if (cJSON_GetArraySize(cameras) > 0)
        json_add(g->root, "cameras", cameras);
    else
        cJSON_Delete(cameras);
}

/* The stand-ins; glTF does not allow an empty array of them. */
static void add_lights(struct glb *g) {
    cJSON *lights = cJSON_CreateArray(), *nodes = cJSON_CreateArray(), *node;
    glb_lights_add(g->in, lights, nodes);
    while ((node = cJSON_DetachItemFromArray(nodes, 0)) != NULL) {
        cJSON_AddItemToArray(g->children, cJSON_CreateNumber(g->node_count++));
        cJSON_AddItemToArray(g->nodes, node);
    }
    cJSON_Delete(nodes);
    if (cJSON_GetArraySize(lights) > 0)
        json_add(add_object(add_object(g->root, "extensions"), "KHR_lights_punctual"), "lights", lights);
    else
        cJSON_Delete(lights);
}

/* Where the turn puts the mesh's offset. */
static void add_translation(cJSON *room, const double o[3], vec3 up) {
    double at[3];
    upright_turn(up, o, at);
    if (o[0] != 0.0 || o[1] != 0.0 || o[2] != 0.0)
        json_add(room, "translation", cJSON_CreateDoubleArray(at, 3));
}

static void add_room(struct glb *g) {
    cJSON *room = append(g->nodes);
    g->node_count++;
    json_add_string(room, "name", "room");
    add_numbers(room, "rotation", upright_quaternion(g->in->up), 4);
    add_translation(room, g->in->mesh->offset, g->in->up);
    if (g->in->environment) {
        cJSON *extras = add_object(room, "extras");
        json_add_string(extras, "environment", OUTPUT_ENVIRONMENT);
        json_add_string(
            extras, "environment_layout",
            "(column + 1/2) over width = atan2(x, -z) / 2 pi modulo 1, row over (height - 1) = acos(y) / pi: "
            "the first and the last row are the poles; in this node's axes");
    }
    g->children = cJSON_AddArrayToObject(room, "children");
}

/* The whole JSON, padded; the caller's. */
static char *describe(struct glb *g) {
    g->root = cJSON_CreateObject();
    cJSON *asset = add_object(g->root, "asset");
    json_add_string(asset, "version", "2.0");
    json_add_string(asset, "generator", "unbake " UNBAKE_VERSION);
    static const char *const used[] = {"KHR_materials_emissive_strength", "KHR_materials_ior", "KHR_materials_specular",
                                       "KHR_lights_punctual"};
    json_add(g->root, "extensionsUsed", cJSON_CreateStringArray(used, g->in->options.glb_has_lights ? 4 : 3));
    json_add_int(append(cJSON_AddArrayToObject(g->root, "buffers")), "byteLength", (int64_t)g->length);
    add_views(g);
    add_pictures(g);
    json_add_int(g->root, "scene", 0);
    cJSON *scene = append(cJSON_AddArrayToObject(g->root, "scenes"));
    json_add_string(scene, "name", g->in->title);
    json_add(scene, "nodes", cJSON_CreateIntArray((int[]){0}, 1));
    g->accessors = cJSON_AddArrayToObject(g->root, "accessors");
    g->nodes = cJSON_AddArrayToObject(g->root, "nodes");
    add_room(g);
    add_parts(g);
    add_cameras(g);
    if (g->in->options.glb_has_lights)
        add_lights(g);
    char *text = json_text(g->root);
    char *whole = mem_printf("%s%*s", text, (int)(padded(strlen(text)) - strlen(text)), "");
    mem_free(text);
    cJSON_Delete(g->root);
    return whole;
}

/* --- bytes ---------------------------------------------------------------------------------- */

static void put_picture(const struct glb *g, struct sink *out, enum buffer_view view, const char *path) {
    uint64_t length = g->view[view].length;
    sink_copy(out, path, length);
    sink_bytes(out, "\0\0\0", padded(length) - length);
}

static void put_bytes(const struct glb *g, struct sink *out, const char *base_color, const char *emission) {
    const struct seams *seams = &g->parts->seams;
    const struct mesh *mesh = g->in->mesh;
    for (size_t v = 0; v < seams->vertex_count; v++)
        sink_vec3(out, seams_position(seams, mesh, v));
    for (size_t v = 0; v < seams->vertex_count && mesh->normal; v++)
        sink_vec3(out, seams_normal(seams, mesh, v));
    for (size_t v = 0; v < seams->vertex_count; v++) {
        vec2 uv = seams_uv(seams, g->in->atlas, v);
        sink_float(out, uv.x);
        sink_float(out, uv.y);
    }
    for (size_t v = 0; v < seams->vertex_count && mesh->uv; v++) {
        vec2 uv = seams_input_uv(seams, mesh, v);
        sink_float(out, uv.x);
        sink_float(out, 1.0f - uv.y);
    }
    for (size_t p = 0; p < g->parts->count; p++) {
        const struct part *part = &g->parts->part[p];
        for (size_t i = part->first_triangle; i < part->first_triangle + part->triangle_count; i++)
            for (int c = 0; c < 3; c++)
                sink_u32(out, seams->index[g->parts->order[i]][c] - (uint32_t)part->first_vertex);
    }
    put_picture(g, out, VIEW_BASE_COLOR, base_color);
    if (g->look.scales)
        put_picture(g, out, VIEW_EMISSION, emission);
}

static void put_chunk_head(struct sink *out, uint64_t length, uint32_t type) {
    sink_u32(out, (uint32_t)length);
    sink_u32(out, type);
}

const struct export_input *glb_shown(const struct export_input *input) {
    return input->options.glb_has_uv && input->baked ? input->baked : input;
}

enum status glb_write(const char *path, const struct export_input *input, const struct parts *parts,
                      const char *base_color, const char *emission, struct error *err) {
    struct stat info, emission_info = {.st_size = 0};
    struct sink out;
    if (stat(base_color, &info) != 0)
        return error_set_errno(err, errno, "cannot access %s", base_color);
    if (input->materials->emission_pattern && stat(emission, &emission_info) != 0)
        return error_set_errno(err, errno, "cannot access %s", emission);
    const struct export_input *shown = glb_shown(input);
    float *scales = emission_texture_scales(shown);
    struct glb g = {.in = input, .parts = parts, .shown = shown};
    g.look = (struct glb_look){input->materials, scales, glb_lights_unit(input), shown != input};
    lay_out(&g, (uint64_t)info.st_size, (uint64_t)emission_info.st_size);
    char *json = describe(&g);
    uint64_t json_length = strlen(json);
    uint64_t length = HEAD_BYTES + 2 * CHUNK_HEAD_BYTES + json_length + g.length;
    enum status status = STATUS_OK;
    if (length > UINT32_MAX) /* fail before gigabytes are written */
        status = error_set(err, STATUS_LIMIT, "%s would have %llu bytes, a GLB has 4 GiB at most", path,
                           (unsigned long long)length);
    if (status == STATUS_OK)
        status = sink_open(&out, path, UINT32_MAX, err);
    if (status == STATUS_OK) {
        sink_u32(&out, MAGIC);
        sink_u32(&out, 2);
        sink_u32(&out, (uint32_t)length);
        put_chunk_head(&out, json_length, CHUNK_JSON);
        sink_bytes(&out, json, json_length);
        put_chunk_head(&out, g.length, CHUNK_BIN);
        put_bytes(&g, &out, base_color, emission);
        status = sink_close(&out, STATUS_OK, err);
    }
    mem_free(json);
    mem_free(scales);
    return status;
}
