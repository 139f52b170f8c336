/* test_input_uv.c -- the input's own texture coordinates: from each format through all that changes triangles to each
 * output, and the textures in their layout. */
#include "common/buf.h"
#include "common/file.h"
#include "common/image.h"
#include "common/json.h"
#include "common/mem.h"
#include "server/demo/room.h"
#include "server/export/glb.h"
#include "server/export/mesh_ply.h"
#include "server/export/outputs.h"
#include "server/export/usd.h"
#include "server/export/uv_bake.h"
#include "server/ingest/mesh/gltf.h"
#include "server/ingest/mesh/mesh_file.h"
#include "server/ingest/mesh/obj.h"
#include "server/ingest/mesh/ply.h"
#include "server/scene/select.h"
#include "tests/check.h"

#define SIZE 256 /* texels */

static bool is_uv(const struct mesh *mesh, size_t triangle, int corner, float u, float v) {
    return triangle < mesh->triangle_count && mesh->uv && fabsf(mesh->uv[triangle][corner].x - u) < 1e-6f &&
           fabsf(mesh->uv[triangle][corner].y - v) < 1e-6f;
}

/* --- readers -------------------------------------------------------------------------------------- */

static void take(const char *name, const char *text, struct mesh *mesh) {
    struct error err = {.message = ""};
    bool is_ply = strstr(name, ".ply") != NULL;
    enum status status = is_ply ? ply_parse(text, strlen(text), name, 99, mesh, NULL, &err)
                                : obj_parse(text, strlen(text), name, NULL, 99, mesh, NULL, NULL, &err);
    CHECK_THAT(status == STATUS_OK, "%s", err.message);
}

/* A square that a polygon's triangulation divides; one face without; a vt that is no number stands for none. */
static void test_obj(void) {
    struct mesh mesh;
    take("a.obj",
         "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nvt 0.25 0.5\nvt 1 0 0\nvt .75 1\nvt 0 1\nvt x 1\n"
         "f 1 2 5\nf 1/1 2/2 3/3 4/4\nf 1/1 2/5 5/2\n",
         &mesh);
    CHECK(mesh.triangle_count == 4 && !mesh_has_uv(&mesh, 0) && mesh_has_uv(&mesh, 1) && !mesh_has_uv(&mesh, 3));
    for (size_t t = 1; t < 3; t++)
        for (int c = 0; c < 3; c++) {
            static const float wanted[4][2] = {{0.25f, 0.5f}, {1, 0}, {0.75f, 1}, {0, 1}};
            uint32_t v = mesh.index[t][c];
            vec3 p = mesh.position[v];
            int corner = p.y < 0.5f ? (p.x < 0.5f ? 0 : 1) : p.x < 0.5f ? 3 : 2;
            CHECK(is_uv(&mesh, t, c, wanted[corner][0], wanted[corner][1]));
        }
    mesh_turn_triangle(&mesh, 1);
    CHECK(mesh_check(&mesh, "a.obj", NULL, NULL) == STATUS_OK && mesh.triangle_count == 3);
    mesh_release(&mesh);
    take("a.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n", &mesh);
    CHECK(!mesh.uv);
    mesh_release(&mesh);
}

#define PLY_HEAD(vertex, face)                                                                                         \
    "ply\nformat ascii 1.0\ncomment TextureFile a.png\nelement vertex 3\nproperty float x\nproperty float y\n"         \
    "property float z\n" vertex "element face 1\nproperty list uchar int vertex_indices\n" face "end_header\n"

static void test_ply(void) {
    struct mesh mesh;
    take("a.ply", PLY_HEAD("property float s\nproperty float t\n", "") "0 0 0 .5 .25\n1 0 0 1 0\n0 1 0 0 1\n3 2 0 1\n",
         &mesh);
    CHECK(is_uv(&mesh, 0, 0, 0, 1) && is_uv(&mesh, 0, 1, 0.5f, 0.25f) && mesh.picture_count == 1);
    mesh_release(&mesh);
    take("a.ply",
         PLY_HEAD("property double texture_u\nproperty double texture_v\n", "") "0 0 0 .5 .25\n1 0 0 1 0\n0 1 0 0 1\n"
                                                                                "3 0 1 2\n",
         &mesh);
    CHECK(is_uv(&mesh, 0, 0, 0.5f, 0.25f));
    mesh_release(&mesh);
    take("a.ply",
         PLY_HEAD("property uchar u\nproperty uchar v\n", "property list uchar float texcoord\n") "0 0 0 7 7\n"
                                                                                                  "1 0 0 7 7\n"
                                                                                                  "0 1 0 7 7\n"
                                                                                                  "3 0 1 2 6 .1 .2 .3 "
                                                                                                  ".4 .5 .6\n",
         &mesh);
    CHECK(is_uv(&mesh, 0, 0, 0.1f, 0.2f) && is_uv(&mesh, 0, 2, 0.5f, 0.6f));
    mesh_release(&mesh);
    take("a.ply", PLY_HEAD("", "property list uchar float texcoord\n") "0 0 0\n1 0 0\n0 1 0\n3 0 1 2 4 1 1 1 1\n",
         &mesh);
    CHECK(!mesh.uv);
    mesh_release(&mesh);
}

/* The picture of base colour says which set, and how it is turned; damage leaves the geometry. */
static void test_gltf(void) {
    static const char json[] =
        "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"byteLength\":60,\"uri\":\"data:application/octet-stream;base64,"
        "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAACAPgAAAD8AAIA/AAAAAAAAAAAAAIA/\"}],"
        "\"bufferViews\":[{\"buffer\":0,\"byteLength\":36},{\"buffer\":0,\"byteOffset\":36,\"byteLength\":24}],"
        "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\"},"
        "{\"bufferView\":1,\"componentType\":5126,\"count\":%d,\"type\":\"VEC2\"}],"
        "\"images\":[{},{}],\"textures\":[{\"source\":1}],\"materials\":[{\"pbrMetallicRoughness\":{\"baseColorTexture\":"
        "{\"index\":0,\"texCoord\":1%s}}}],\"meshes\":[{\"primitives\":[{\"material\":0,\"attributes\":"
        "{\"POSITION\":0,\"TEXCOORD_1\":1}}]}],\"nodes\":[{\"mesh\":0}]}";
    static const char turned[] = ",\"extensions\":{\"KHR_texture_transform\":{\"offset\":[0.5,0],\"rotation\":"
                                 "1.5707963267948966,\"scale\":[0.5,2]}}";
    for (int i = 0; i < 3; i++) {
        struct mesh mesh;
        struct faces_report report;
        struct error err = {.message = ""};
        char *text = mem_printf(json, i == 2 ? 2 : 3, i == 1 ? turned : "");
        CHECK_THAT(gltf_parse(text, strlen(text), "a.gltf", NULL, 9, &mesh, NULL, &report, &err) == STATUS_OK, "%s",
                   err.message);
        CHECK(mesh.picture_count == 1 && mesh.triangle_count == 1);
        if (i == 0)
            CHECK(is_uv(&mesh, 0, 0, 0.25f, 0.5f) && is_uv(&mesh, 0, 1, 1, 1) && is_uv(&mesh, 0, 2, 0, 0));
        else if (i == 1) /* (u, v) to (1/2 + 2 v, -u/2) */
            CHECK(is_uv(&mesh, 0, 0, 1.5f, 1.125f) && is_uv(&mesh, 0, 1, 0.5f, 1.5f) && is_uv(&mesh, 0, 2, 2.5f, 1));
        else
            CHECK(!mesh.uv && report.note_count == 1 && strstr(report.note[0], "texture coordinates"));
        mesh_release(&mesh);
        mem_free(text);
    }
}

/* Cropping, dropping and turning keep corners and their coordinates together. */
static void test_kept(void) {
    struct scene scene = {0};
    struct error err = {.message = ""};
    size_t left_out;
    take("a.obj",
         "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 5 0 0\nv 6 0 0\nv 5 1 0\nvt 0 0\nvt .1 .2\nvt .3 .4\nvt .5 .6\n"
         "f 1/1 1/2 2/3\nf 1/1 2/2 3/3\nf 4/2 5/3 6/4\n",
         &scene.mesh);
    CHECK(mesh_check(&scene.mesh, "a.obj", NULL, &err) == STATUS_OK && scene.mesh.triangle_count == 2);
    CHECK(is_uv(&scene.mesh, 0, 1, 0.1f, 0.2f) && is_uv(&scene.mesh, 1, 2, 0.5f, 0.6f));
    CHECK(scene_crop(&scene, (double[]){4, -1, -1}, (double[]){7, 2, 1}, &left_out, &err) == STATUS_OK);
    CHECK(left_out == 1 && is_uv(&scene.mesh, 0, 0, 0.1f, 0.2f) && is_uv(&scene.mesh, 0, 2, 0.5f, 0.6f));
    mesh_turn_triangle(&scene.mesh, 0);
    CHECK(is_uv(&scene.mesh, 0, 1, 0.5f, 0.6f) && scene.mesh.position[scene.mesh.index[0][1]].y == 1.0f);
    mesh_release(&scene.mesh);
}

/* --- textures in the input's layout ---------------------------------------------------------------- */

/* Base colour of a place of the room, smooth within each texel. */
static rgb color_at(vec3 p) {
    return rgb_make(0.5f + 0.4f * sinf(p.x), 0.5f + 0.4f * sinf(p.y + 1.0f), 0.5f + 0.4f * sinf(p.z + 2.0f));
}

static void paint(struct room *room) {
    for (size_t i = 0; i < room->inverse.valid_count; i++) {
        uint32_t texel = room->inverse.valid[i], t;
        float b1, b2;
        inverse_uv_lookup(&room->inverse, &room->atlas, (float)(texel % SIZE) + 0.5f, (float)(texel / SIZE) + 0.5f, &t,
                          &b1, &b2);
        rgb c = color_at(mesh_point(&room->mesh, t, b1, b2));
        float *out = room->materials.base_color.texel[texel];
        out[0] = c.r;
        out[1] = c.g;
        out[2] = c.b;
        room->materials.deviation[texel] = image_half_from_float(0.05f);
    }
}

/* The atlas mirrored in its diagonal and moved by a third of a texel: no texel of it is one of ours. */
static void lay_out(struct room *room) {
    struct mesh *mesh = &room->mesh;
    mesh->uv = mem_array(mesh->triangle_count, sizeof *mesh->uv);
    for (size_t i = 0; i < 3 * mesh->triangle_count; i++) {
        vec2 at = room->atlas.corner[i / 3][i % 3];
        mesh->uv[i / 3][i % 3] =
            (vec2){0.99f * (at.y + 0.33f) / (float)SIZE, 1.0f - 0.99f * (at.x + 0.33f) / (float)SIZE};
    }
}

static void test_bake(const struct export_input *in) {
    struct uv_bake bake;
    uv_bake_make(&bake, in);
    CHECK_THAT(bake.is_made && bake.overlap_share <= 0.002 && fabs(bake.uv_share - 1.0) < 1e-6, "%s %g %g", bake.reason,
               bake.overlap_share, bake.uv_share);
    double sum = 0.0;
    size_t count = 0;
    for (size_t i = 0; bake.is_made && i < bake.inverse.valid_count; i++) {
        uint32_t texel = bake.inverse.valid[i], t;
        float b1, b2;
        inverse_uv_lookup(&bake.inverse, &bake.atlas, (float)(texel % SIZE) + 0.5f, (float)(texel / SIZE) + 0.5f, &t,
                          &b1, &b2);
        rgb wanted = color_at(mesh_point(in->mesh, t, b1, b2));
        const float *c = bake.materials.base_color.texel[texel];
        float off = fmaxf(fabsf(c[0] - wanted.r), fmaxf(fabsf(c[1] - wanted.g), fabsf(c[2] - wanted.b)));
        CHECK_THAT(off < 0.05f, "texel %u: %g", texel,
                   (double)off); /* a texel is 4 cm, and at charts' edges half is lost */
        sum += (double)(off * off);
        count++;
        CHECK(bake.materials.deviation[texel] == image_half_from_float(0.05f));
    }
    CHECK_THAT(count > 10000 && sqrt(sum / (double)count) < 0.003, "%zu texels: %g", count, sqrt(sum / (double)count));
    uv_bake_release(&bake);
}

static void refused(const struct export_input *in, const char *part) {
    struct uv_bake bake;
    uv_bake_make(&bake, in);
    CHECK_THAT(!bake.is_made && strstr(bake.reason, part), "%s, not %s", bake.reason, part);
    uv_bake_release(&bake);
}

static void scale(struct mesh *mesh, float by, float move) {
    for (size_t i = 0; i < 3 * mesh->triangle_count; i++) {
        vec2 *uv = &mesh->uv[i / 3][i % 3];
        *uv = (vec2){by * uv->x + move, by * uv->y};
    }
}

static void test_refused(struct export_input *in, struct room *room) {
    struct mesh *mesh = &room->mesh;
    vec2 kept[3];
    in->options.bakes_uv = false;
    refused(in, "bake_uv is off");
    in->options.bakes_uv = true;
    mesh->picture_count = 2;
    refused(in, "2 pictures");
    mesh->picture_count = 0;
    scale(mesh, 1.0f, 1.5f);
    refused(in, "unit square");
    scale(mesh, 1.0f, -1.5f);
    scale(mesh, 0.05f, 0.0f);
    refused(in, "cover only"); /* so small that triangles hold no centre of a texel */
    scale(mesh, 20.0f, 0.0f);
    size_t largest = 0, other = 0; /* the largest laid over the next */
    double most[2] = {0.0, 0.0};
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        double area = (double)vec3_length(mesh_cross(mesh, t));
        if (area > most[0]) {
            other = largest, most[1] = most[0];
            largest = t, most[0] = area;
        } else if (area > most[1]) {
            other = t, most[1] = area;
        }
    }
    memcpy(kept, mesh->uv[other], sizeof kept);
    memcpy(mesh->uv[other], mesh->uv[largest], sizeof kept);
    refused(in, "overlap");
    memcpy(mesh->uv[other], kept, sizeof kept);
}

/* --- outputs ---------------------------------------------------------------------------------------- */

/* Each corner of the file's mesh has the coordinates of the same corner of the room's. */
static void check_mesh(const char *path, const struct mesh *wanted) {
    struct mesh mesh;
    struct error err = {.message = ""};
    CHECK_THAT(mesh_file_read(path, path, 1 << 20, &mesh, NULL, &err) == STATUS_OK, "%s", err.message);
    CHECK(mesh.triangle_count == wanted->triangle_count && mesh.uv);
    size_t found = 0;
    for (size_t t = 0; t < mesh.triangle_count && mesh.uv; t++) { /* by segments: in another order */
        for (size_t w = 0; w < wanted->triangle_count; w++) {
            bool same = true;
            for (int c = 0; c < 3 && same; c++) {
                vec3 p = mesh.position[mesh.index[t][c]], q = wanted->position[wanted->index[w][c]];
                same = p.x == q.x && p.y == q.y && p.z == q.z &&
                       is_uv(&mesh, t, c, wanted->uv[w][c].x, wanted->uv[w][c].y);
            }
            found += same;
            if (same)
                break;
        }
    }
    CHECK_THAT(found == wanted->triangle_count, "%s: %zu of %zu", path, found, wanted->triangle_count);
    mesh_release(&mesh);
}

/* The primitive attributes and the material of a GLB. */
static void check_glb(const char *path, bool shows_input, size_t primitives) {
    struct buf file;
    struct error err;
    cJSON *json = NULL;
    buf_init(&file, 1 << 26);
    CHECK(file_read(path, &file, &err) == STATUS_OK);
    const unsigned char *b = (const unsigned char *)file.data;
    size_t length = (size_t)b[12] | (size_t)b[13] << 8 | (size_t)b[14] << 16;
    CHECK(json_parse(file.data + 20, length, path, &json, &err) == STATUS_OK);
    const cJSON *item;
    size_t with = 0, of_input = 0;
    cJSON_ArrayForEach(item, cJSON_GetObjectItem(json, "meshes")) {
        const cJSON *primitive = cJSON_GetArrayItem(cJSON_GetObjectItem(item, "primitives"), 0);
        with += cJSON_GetObjectItem(cJSON_GetObjectItem(primitive, "attributes"), "TEXCOORD_1") != NULL;
    }
    cJSON_ArrayForEach(item, cJSON_GetObjectItem(json, "materials")) {
        const cJSON *use = cJSON_GetObjectItem(cJSON_GetObjectItem(item, "pbrMetallicRoughness"), "baseColorTexture");
        of_input += cJSON_GetNumberValue(cJSON_GetObjectItem(use, "texCoord")) == 1.0;
    }
    CHECK_THAT(with == primitives && of_input == (shows_input ? primitives : 0), "%zu, %zu", with, of_input);
    cJSON_Delete(json);
    buf_release(&file);
}

static void test_outputs(const char *dir, struct export_input *in) {
    struct error err = {.message = ""};
    struct image ours, baked;
    CHECK_THAT(export_outputs(dir, in, NULL, NULL, &err) == STATUS_OK, "%s", err.message);
    char *ply = file_join(dir, "scene.ply"), *glb = file_join(dir, "scene.glb"), *usd = file_join(dir, "scene.usda"),
         *report = file_join(dir, "report.json"), *a = file_join(dir, "base_color.exr"),
         *b = file_join(dir, "uv_base_color.exr"), *confidence = file_join(dir, "uv_confidence.exr"),
         *png = file_join(dir, "uv_base_color.png");
    struct buf text;
    buf_init(&text, 1 << 26);
    CHECK(file_read(ply, &text, &err) == STATUS_OK &&
          strstr(buf_text(&text), "property float s1\nproperty float t1\n"));
    buf_release(&text);
    buf_init(&text, 1 << 26);
    CHECK(file_read(usd, &text, &err) == STATUS_OK && strstr(buf_text(&text), "texCoord2f[] primvars:st1 = [("));
    buf_release(&text);
    check_glb(glb, in->options.glb_has_uv, in->segments->count);
    if (in->options.glb_has_uv)
        check_mesh(glb, in->mesh);
    cJSON *tree = NULL;
    CHECK(json_read(report, 1 << 26, &tree, &err) == STATUS_OK);
    const cJSON *said = cJSON_GetObjectItem(tree, "input_uv");
    CHECK(cJSON_IsTrue(cJSON_GetObjectItem(said, "baked")));
    CHECK(cJSON_GetNumberValue(cJSON_GetObjectItem(said, "texture_size")) == SIZE);
    cJSON_Delete(tree);
    CHECK(image_read(a, &ours, NULL, &err) == STATUS_OK && image_read(b, &baked, NULL, &err) == STATUS_OK);
    CHECK(baked.width == SIZE && baked.height == SIZE);
    image_release(&ours);
    image_release(&baked);
    CHECK(image_read(confidence, &ours, NULL, &err) == STATUS_OK && image_read(png, &baked, NULL, &err) == STATUS_OK);
    image_release(&ours);
    image_release(&baked);
    mem_free(ply), mem_free(glb), mem_free(usd), mem_free(report), mem_free(a), mem_free(b), mem_free(confidence);
    mem_free(png);
}

int main(void) {
    char dir[] = "/tmp/unbake-input-uv-XXXXXX";
    struct parallel *pool = parallel_new(1);
    struct room room;
    struct error err;
    CHECK(mkdtemp(dir) != NULL);
    test_obj();
    test_ply();
    test_gltf();
    test_kept();
    CHECK(room_init(&room, &(struct room_look){SIZE, 15.0f, 15.0f, false}, pool, &err) == STATUS_OK);
    materials_start_deviation(&room.materials);
    paint(&room);
    lay_out(&room);
    cJSON *report = cJSON_CreateObject();
    struct export_input in = {.title = "room",
                              .mesh = &room.mesh,
                              .segments = &room.segments,
                              .atlas = &room.atlas,
                              .inverse = &room.inverse,
                              .materials = &room.materials,
                              .report = report,
                              .has_materials = true,
                              .options = {.bakes_uv = true},
                              .pool = pool};
    bool is_emitter[ROOM_OBJECT_COUNT] = {[ROOM_WALL_EMITTER] = true, [ROOM_CEILING_EMITTER] = true};
    in.is_emitter = is_emitter;
    test_bake(&in);
    test_refused(&in, &room);
    test_outputs(dir, &in);
    in.options.glb_has_uv = true;
    for (size_t t = 0; t < room.mesh.triangle_count; t += 7) { /* seams within charts, on the same area */
        vec2 *uv = room.mesh.uv[t], first = uv[0];
        uv[0] = uv[1];
        uv[1] = uv[2];
        uv[2] = first;
    }
    test_outputs(dir, &in);
    cJSON_Delete(report);
    room_release(&room);
    parallel_free(pool);
    CHECK(file_remove_tree(dir, NULL) == STATUS_OK);
    return check_result();
}
