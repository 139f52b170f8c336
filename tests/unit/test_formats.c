/* test_formats.c -- scene.glb and scene.obj read back: the structure that the glTF 2.0 specification
 * asks for, and the room's own numbers in it. */
#include "common/buf.h"
#include "server/export/glb.h"
#include "server/export/mesh_obj.h"
#include "server/ingest/mesh/mesh_file.h"
#include "server/worker/read_back.h"
#include "tests/unit/formats_rig.h"
#include "tests/unit/glb_view.h"

static float float_at(const char *at) {
    float value;
    memcpy(&value, at, sizeof value);
    return value;
}

/* The accessor's elements, which must lie within its view and be aligned. */
static const char *elements(const struct glb *g, double accessor, const char *type, size_t bytes, size_t *count) {
    const cJSON *a = item(g, "accessors", accessor), *view = item(g, "bufferViews", number(a, "bufferView"));
    size_t offset = (size_t)number(a, "byteOffset"), start = (size_t)number(view, "byteOffset");
    *count = (size_t)number(a, "count");
    CHECK_STRING(cJSON_GetStringValue(cJSON_GetObjectItem(a, "type")), type);
    CHECK(*count > 0 && offset + *count * bytes <= (size_t)number(view, "byteLength"));
    CHECK(start + (size_t)number(view, "byteLength") <= g->length);
    CHECK(start % 4 == 0 && offset % 4 == 0);
    return g->bytes + start + offset;
}

static void check_bounds(const struct glb *g, double accessor, const char *position, size_t count) {
    const cJSON *a = item(g, "accessors", accessor);
    for (int c = 0; c < 3; c++) {
        float lower = INFINITY, upper = -INFINITY;
        for (size_t v = 0; v < count; v++) {
            lower = fminf(lower, float_at(position + 12 * v + 4 * c));
            upper = fmaxf(upper, float_at(position + 12 * v + 4 * c));
        }
        CHECK((float)cJSON_GetArrayItem(cJSON_GetObjectItem(a, "min"), c)->valuedouble == lower);
        CHECK((float)cJSON_GetArrayItem(cJSON_GetObjectItem(a, "max"), c)->valuedouble == upper);
    }
}

/* A mesh against the triangles of its segment; returns their number. */
static size_t check_mesh(const struct glb *g, const struct export_input *in, const cJSON *mesh, uint32_t segment) {
    const cJSON *primitive = cJSON_GetArrayItem(cJSON_GetObjectItem(mesh, "primitives"), 0);
    const cJSON *attributes = cJSON_GetObjectItem(primitive, "attributes");
    size_t vertices, normals = 0, uvs, corners, triangle = 0;
    double positions = number(attributes, "POSITION");
    const char *position = elements(g, positions, "VEC3", 12, &vertices), *normal = NULL;
    if (in->mesh->normal)
        normal = elements(g, number(attributes, "NORMAL"), "VEC3", 12, &normals);
    else
        CHECK(!cJSON_GetObjectItem(attributes, "NORMAL"));
    const char *uv = elements(g, number(attributes, "TEXCOORD_0"), "VEC2", 8, &uvs);
    const char *index = elements(g, number(primitive, "indices"), "SCALAR", 4, &corners);
    CHECK(uvs == vertices && (!normal || normals == vertices) && corners % 3 == 0);
    check_bounds(g, positions, position, vertices);
    for (size_t t = 0; t < in->mesh->triangle_count; t++) {
        if (in->segments->of_triangle[t] != segment)
            continue;
        for (size_t c = 0; c < 3; c++) {
            uint32_t v = word_at(index + 4 * (3 * triangle + c));
            uint32_t wanted = in->mesh->index[t][c];
            CHECK(v < vertices);
            CHECK(memcmp(position + 12 * v, &in->mesh->position[wanted], 12) == 0);
            CHECK(!normal || memcmp(normal + 12 * v, &in->mesh->normal[wanted], 12) == 0);
            CHECK_NEAR(float_at(uv + 8 * v) * (float)in->atlas->width, in->atlas->corner[t][c].x, 1e-3);
            CHECK_NEAR(float_at(uv + 8 * v + 4) * (float)in->atlas->height, in->atlas->corner[t][c].y, 1e-3);
        }
        triangle++;
    }
    CHECK(3 * triangle == corners);
    return triangle;
}

/* The reflectance at normal incidence and the radiance are ours. */
static void check_material(const cJSON *material, const struct materials *m, uint32_t s) {
    const cJSON *extensions = cJSON_GetObjectItem(material, "extensions");
    const cJSON *factor = cJSON_GetObjectItem(material, "emissiveFactor");
    double ior = number(cJSON_GetObjectItem(extensions, "KHR_materials_ior"), "ior");
    double weight = number(cJSON_GetObjectItem(extensions, "KHR_materials_specular"), "specularFactor");
    double r = (ior - 1.0) / (ior + 1.0);
    CHECK_NEAR(weight * r * r, 0.08 * (double)m->specular[s], 1e-7);
    CHECK(weight == (m->specular[s] > 0.0f ? 1.0 : 0.0));
    CHECK(number(cJSON_GetObjectItem(material, "pbrMetallicRoughness"), "roughnessFactor") == (double)m->roughness[s]);
    CHECK(number(cJSON_GetObjectItem(material, "pbrMetallicRoughness"), "metallicFactor") == 0.0);
    bool shines = rgb_max(m->emission[s]) > 0.0f;
    CHECK(cJSON_IsTrue(cJSON_GetObjectItem(material, "doubleSided")) == !shines);
    CHECK((factor != NULL) == shines);
    const float wanted[3] = {m->emission[s].r, m->emission[s].g, m->emission[s].b};
    for (int c = 0; c < 3 && shines; c++) {
        double f = cJSON_GetArrayItem(factor, c)->valuedouble;
        double strength =
            number(cJSON_GetObjectItem(extensions, "KHR_materials_emissive_strength"), "emissiveStrength");
        CHECK(f >= 0.0 && f <= 1.0);
        CHECK_NEAR(f * strength, wanted[c], 1e-6 * strength);
    }
}

/* The room's node turns `up` to +y and has everything below it. */
static void check_nodes(const struct glb *g, vec3 up, size_t part_count, const struct camera *camera) {
    const cJSON *room = item(g, "nodes", 0), *rotation = cJSON_GetObjectItem(room, "rotation");
    double q[4];
    for (int i = 0; i < 4; i++)
        q[i] = cJSON_GetArrayItem(rotation, i)->valuedouble;
    /* v + 2 w (q x v) + 2 q x (q x v), y */
    double v[3] = {(double)up.x, (double)up.y, (double)up.z};
    double a[3] = {q[1] * v[2] - q[2] * v[1], q[2] * v[0] - q[0] * v[2], q[0] * v[1] - q[1] * v[0]};
    CHECK_NEAR(v[1] + 2.0 * (q[3] * a[1] + q[2] * a[0] - q[0] * a[2]), 1.0, 1e-6);
    CHECK_NEAR(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3], 1.0, 1e-6);
    CHECK(cJSON_GetArraySize(cJSON_GetObjectItem(room, "children")) == (int)part_count + 1);
    const cJSON *node = item(g, "nodes", (double)part_count + 1), *m = cJSON_GetObjectItem(node, "matrix");
    CHECK(number(node, "camera") == 0.0 && cJSON_GetArraySize(m) == 16);
    /* theirs looks along -z, its y is up */
    for (int i = 0; i < 3; i++) {
        const float *row = camera->world_from_camera.rotation[i];
        CHECK_NEAR(cJSON_GetArrayItem(m, i)->valuedouble, row[0], 0);
        CHECK_NEAR(cJSON_GetArrayItem(m, 4 + i)->valuedouble, -row[1], 0);
        CHECK_NEAR(cJSON_GetArrayItem(m, 8 + i)->valuedouble, -row[2], 0);
    }
    CHECK(cJSON_GetArrayItem(m, 14)->valuedouble == 3.0);
}

static void test_glb(const char *dir, struct export_input *in, const struct parts *parts) {
    static const vec3 axes[] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {-1, 0, 0}, {0, -1, 0}, {0, 0, -1}};
    struct error err = {0};
    struct glb g;
    char *path = file_join(dir, "scene.glb"), *png = file_join(dir, FORMATS_BASE_COLOR);
    size_t triangles = 0;
    for (size_t i = 0; i < sizeof axes / sizeof *axes; i++) {
        in->up = axes[i];
        CHECK(glb_write(path, in, parts, png, "/nowhere", &err) == STATUS_OK);
        read_glb(path, &g);
        check_nodes(&g, axes[i], parts->count, in->comparison->camera);
        if (i + 1 < sizeof axes / sizeof *axes)
            release_glb(&g);
    }
    for (size_t p = 0; p < parts->count; p++) {
        const cJSON *node = item(&g, "nodes", (double)p + 1), *mesh = item(&g, "meshes", number(node, "mesh"));
        uint32_t s = parts->part[p].segment;
        char name[32];
        snprintf(name, sizeof name, "segment %u", s);
        CHECK_STRING(cJSON_GetStringValue(cJSON_GetObjectItem(node, "name")), name);
        triangles += check_mesh(&g, in, mesh, s);
        check_material(item(&g, "materials", (double)p), in->materials, s);
    }
    CHECK(triangles == in->mesh->triangle_count);
    check_picture(&g, 0, png);
    release_glb(&g);
    mem_free(png);
    mem_free(path);
}

/* Stand-ins on request: every light has a node below the room, and the emission is in their unit. */
static void test_lights(const char *dir, struct export_input *in, const struct parts *parts) {
    struct error err = {0};
    struct glb g;
    char *path = file_join(dir, "scene.glb"), *png = file_join(dir, FORMATS_BASE_COLOR);
    in->options.glb_has_lights = true;
    in->luminance_per_unit = 50.0;
    CHECK(glb_write(path, in, parts, png, "/nowhere", &err) == STATUS_OK);
    read_glb(path, &g);
    const cJSON *lights = cJSON_GetObjectItem(member(g.json, "extensions", "KHR_lights_punctual"), "lights");
    const cJSON *children = cJSON_GetObjectItem(item(&g, "nodes", 0.0), "children"), *child;
    int count = cJSON_GetArraySize(lights), found = 0;
    cJSON_ArrayForEach(child, children) {
        const cJSON *use = member(item(&g, "nodes", cJSON_GetNumberValue(child)), "extensions", "KHR_lights_punctual");
        found += use && number(use, "light") >= 0.0 && number(use, "light") < count;
    }
    CHECK_THAT(count == 2 && found == 2, "%d lights, %d nodes", count, found);
    CHECK(strstr(cJSON_GetStringValue(cJSON_GetArrayItem(cJSON_GetObjectItem(g.json, "extensionsUsed"), 3)), "lights"));
    const cJSON *extensions = cJSON_GetObjectItem(item(&g, "materials", ROOM_CEILING_EMITTER), "extensions");
    double strength = number(cJSON_GetObjectItem(extensions, "KHR_materials_emissive_strength"), "emissiveStrength");
    CHECK_NEAR(strength, 50.0 * (double)rgb_max(in->materials->emission[ROOM_CEILING_EMITTER]), 1e-2);
    release_glb(&g);
    in->options.glb_has_lights = false;
    in->luminance_per_unit = 0.0;
    mem_free(png);
    mem_free(path);
}

static size_t count_lines(const char *text, const char *start) {
    size_t count = 0;
    for (const char *at = text; at; at = strchr(at, '\n'))
        count += strncmp(at += at > text || *at == '\n', start, strlen(start)) == 0;
    return count;
}

static void test_obj(const char *dir, const struct export_input *in, const struct parts *parts) {
    struct error err;
    struct buf file;
    char *path = file_join(dir, "scene.obj");
    unsigned v[3], uv[3], n[3];
    vec3 p;
    CHECK(mesh_obj_write(path, in, parts, &err) == STATUS_OK);
    buf_init(&file, 1 << 26);
    CHECK(file_read(path, &file, &err) == STATUS_OK);
    const char *text = buf_text(&file), *first = strstr(text, "\nv "), *face = strstr(text, "\nf ");
    CHECK(count_lines(text, "v ") == in->mesh->vertex_count);
    CHECK(count_lines(text, "vt ") == parts->seams.vertex_count);
    CHECK(count_lines(text, "f ") == in->mesh->triangle_count);
    CHECK(count_lines(text, "o segment_") == parts->count);
    CHECK(first && sscanf(first, " v %f %f %f", &p.x, &p.y, &p.z) == 3);
    CHECK(memcmp(&p, in->mesh->position, sizeof p) == 0);
    CHECK(face &&
          sscanf(face, " f %u/%u/%u %u/%u/%u %u/%u/%u", v, uv, n, v + 1, uv + 1, n + 1, v + 2, uv + 2, n + 2) == 9);
    for (int c = 0; c < 3; c++) {
        CHECK(v[c] == in->mesh->index[parts->order[0]][c] + 1 && n[c] == v[c]);
        CHECK(uv[c] == parts->seams.index[parts->order[0]][c] + 1);
    }
    mem_free(path);
    path = file_join(dir, "scene.mtl");
    CHECK(mesh_mtl_write(path, in, parts, "base_color.png", "emission.png", &err) == STATUS_OK);
    buf_clear(&file);
    CHECK(file_read(path, &file, &err) == STATUS_OK);
    CHECK(count_lines(buf_text(&file), "newmtl segment_") == parts->count);
    CHECK(count_lines(buf_text(&file), "map_Kd base_color.png") == parts->count);
    CHECK(count_lines(buf_text(&file), "Ke ") == 2);
    buf_release(&file);
    mem_free(path);
}

/* What our own readers make of it is the mesh, by segments. */
static void test_round(const char *dir, const char *name, const struct export_input *in, const struct parts *parts) {
    struct error err;
    struct mesh mesh;
    char *path = file_join(dir, name);
    CHECK_THAT(mesh_file_read(path, name, 1 << 20, &mesh, NULL, &err) == STATUS_OK, "%s", err.message);
    CHECK(mesh.triangle_count == in->mesh->triangle_count && mesh.normal && mesh.object_id);
    for (size_t t = 0; t < mesh.triangle_count; t++) {
        uint32_t from = parts->order[t];
        CHECK(parts->part[mesh.object_id[t]].segment == in->segments->of_triangle[from]);
        for (int c = 0; c < 3; c++) {
            uint32_t a = mesh.index[t][c], b = in->mesh->index[from][c];
            CHECK(vec3_length(vec3_sub(mesh.position[a], in->mesh->position[b])) == 0.0f); /* -0 is 0 */
            CHECK(vec3_length(vec3_sub(mesh.normal[a], in->mesh->normal[b])) == 0.0f);
        }
    }
    mesh_release(&mesh);
    mem_free(path);
}

/* A mesh far from the origin of its input comes back there, turned upright by glTF alone. */
static void test_far(const char *dir, struct export_input *in, struct mesh *room, const struct parts *parts) {
    static const double far[3] = {600000.0, -4100000.0, 105.0};
    static const struct {
        const char *name;
        vec3 up;
        int axis[3], sign[3]; /* of the room's axes in the file */
    } table[] = {
        {"scene.obj", {0, 1, 0}, {0, 1, 2}, {1, 1, 1}},    {"scene.glb", {0, 1, 0}, {0, 1, 2}, {1, 1, 1}},
        {"scene.glb", {0, -1, 0}, {0, 1, 2}, {1, -1, -1}}, {"scene.glb", {0, 0, 1}, {0, 2, 1}, {1, 1, -1}},
        {"scene.glb", {0, 0, -1}, {0, 2, 1}, {1, -1, 1}},  {"scene.glb", {1, 0, 0}, {1, 0, 2}, {-1, 1, 1}},
        {"scene.glb", {-1, 0, 0}, {1, 0, 2}, {1, -1, 1}},
    };
    memcpy(room->offset, far, sizeof far);
    for (size_t i = 0; i < sizeof table / sizeof *table; i++) {
        struct error err = {.message = ""};
        struct mesh mesh;
        char *path = file_join(dir, table[i].name);
        in->up = table[i].up;
        for (size_t f = 0; f < FORMATS_COUNT; f++)
            CHECK(strcmp(formats[f].name, table[i].name) != 0 || formats[f].write(dir, in, parts, &err) == STATUS_OK);
        CHECK_THAT(mesh_file_read(path, table[i].name, 1 << 20, &mesh, NULL, &err) == STATUS_OK, "%s", err.message);
        vec3 a = mesh.position[mesh.index[0][0]], b = room->position[room->index[parts->order[0]][0]];
        const float found[3] = {a.x, a.y, a.z}, own[3] = {b.x, b.y, b.z};
        for (int k = 0; k < 3; k++)
            CHECK_NEAR(mesh.offset[k] + (double)found[k],
                       table[i].sign[k] * (far[table[i].axis[k]] + (double)own[table[i].axis[k]]), 1e-5);
        CHECK_THAT(read_back(path, table[i].name, room, &err) == STATUS_OK, "case %zu: %s", i, err.message);
        room->offset[0] += 1.0; /* elsewhere */
        CHECK(read_back(path, table[i].name, room, &err) == STATUS_CORRUPT);
        room->offset[0] -= 1.0;
        mesh_release(&mesh);
        mem_free(path);
    }
    memset(room->offset, 0, sizeof room->offset);
}

static void test_same_bytes(const char *dir, const struct export_input *in, const struct parts *parts) {
    struct error err;
    struct buf once, twice;
    for (size_t f = 0; f < FORMATS_COUNT; f++) {
        char *path = file_join(dir, formats[f].name);
        buf_init(&once, 1 << 26);
        buf_init(&twice, 1 << 26);
        CHECK(formats[f].write(dir, in, parts, &err) == STATUS_OK && file_read(path, &once, &err) == STATUS_OK);
        CHECK(formats[f].write(dir, in, parts, &err) == STATUS_OK && file_read(path, &twice, &err) == STATUS_OK);
        CHECK(once.length == twice.length && memcmp(once.data, twice.data, once.length) == 0);
        CHECK(formats[f].write("/nowhere", in, parts, &err) != STATUS_OK && strstr(err.message, "/nowhere"));
        buf_release(&once);
        buf_release(&twice);
        mem_free(path);
    }
}

int main(void) {
    struct formats_rig r;
    struct error err;
    formats_rig_open(&r);
    char *png = file_join(r.dir, FORMATS_BASE_COLOR), *glb = file_join(r.dir, "scene.glb");
    test_glb(r.dir, &r.in, &r.parts);
    test_obj(r.dir, &r.in, &r.parts);
    test_lights(r.dir, &r.in, &r.parts);
    r.in.up = (vec3){0.0f, 1.0f, 0.0f};
    CHECK(glb_write(glb, &r.in, &r.parts, png, "/nowhere", &err) == STATUS_OK);
    test_round(r.dir, "scene.obj", &r.in, &r.parts);
    test_round(r.dir, "scene.glb", &r.in, &r.parts);
    test_far(r.dir, &r.in, &r.room.mesh, &r.parts);
    r.in.up = (vec3){0.0f, 1.0f, 0.0f};
    test_same_bytes(r.dir, &r.in, &r.parts);
    vec3 *normal = r.room.mesh.normal;
    r.room.mesh.normal = NULL;
    test_glb(r.dir, &r.in, &r.parts);
    r.room.mesh.normal = normal;
    mem_free(glb);
    mem_free(png);
    formats_rig_close(&r);
    return check_result();
}
