/* outputs.c: a job's files, written and read back. */
#include "common/buf.h"
#include "common/image.h"
#include "common/json.h"
#include "common/settings.h"
#include "server/demo/room.h"
#include "server/export/pictures.h"
#include "server/ingest/findings.h"
#include "server/ingest/mesh/mesh_file.h"
#include "server/ingest/transforms.h"
#include "tests/unit/export_rig.h"

static void read_back(const char *dir, const char *name, struct image *image) {
    struct error err;
    char *path = file_join(dir, name);
    enum status status = image_read(path, image, NULL, &err);
    CHECK_THAT(status == STATUS_OK, "%s", err.message);
    mem_free(path);
}

/* EXR files say in their headers what made them, of what, and the unit of their values. */
static void test_headers(const char *dir) {
    static const struct {
        const char *file, *attribute, *text;
    } table[] = {
        {"base_color.exr", "software", "unbake " UNBAKE_VERSION},
        {"base_color.exr", "job", "room <1> & \"2\""},
        {"base_color.exr", "seed", "7"},
        {"base_color.exr", "units", "reflectance"},
        {"emission.exr", "units", "radiance of which"},
        {"confidence.exr", "units", "standard deviation of base_color"},
    };
    for (size_t i = 0; i < sizeof table / sizeof *table; i++) {
        struct error err;
        struct buf file;
        char *path = file_join(dir, table[i].file), wanted[64];
        int length = snprintf(wanted, sizeof wanted, "%s", table[i].attribute);
        memcpy(wanted + length + 1, "string", 7); /* the layout of an attribute: name, type, size, value */
        buf_init(&file, 1 << 26);
        CHECK(file_read(path, &file, &err) == STATUS_OK);
        const char *at = memmem(file.data, file.length, wanted, (size_t)length + 8);
        CHECK_THAT(at && strncmp(at + length + 8 + 4, table[i].text, strlen(table[i].text)) == 0, "%s: %s",
                   table[i].file, table[i].attribute);
        buf_release(&file);
        mem_free(path);
    }
}

/* Valid texels hold the values, the margin holds a valid neighbour's, the rest is 0. */
static void test_textures(const char *dir, const struct export_input *in) {
    struct image color, roughness, emission, confidence;
    read_back(dir, "base_color.exr", &color);
    read_back(dir, "roughness.exr", &roughness);
    read_back(dir, "emission.exr", &emission);
    read_back(dir, "confidence.exr", &confidence);
    CHECK(color.width == in->atlas->width && color.height == in->atlas->height);
    CHECK_STRING(confidence.channel[0], "R");
    CHECK(confidence.channel_count == 3);
    size_t margin = 0;
    for (size_t i = 0; i < (size_t)color.width * color.height; i++) {
        uint32_t triangle = in->inverse->triangle[i];
        bool filled = color.pixel[3 * i] != 0.0f;
        if (triangle == INVERSE_UV_NONE) {
            margin += filled;
            CHECK(confidence.pixel[3 * i] == 0.0f);
            continue;
        }
        uint32_t s = in->segments->of_triangle[triangle];
        float wanted = in->materials->base_color.texel[i][1];
        CHECK_NEAR(color.pixel[3 * i + 1], wanted, 1e-3f * wanted);
        CHECK_NEAR(roughness.pixel[3 * i], in->materials->roughness[s], 1e-3);
        CHECK_NEAR(emission.pixel[3 * i + 2], in->materials->emission[s].b, 1e-3f * in->materials->emission[s].b);
        CHECK(confidence.pixel[3 * i + 1] == materials_deviation(in->materials, i).g &&
              confidence.pixel[3 * i + 1] > 0.0f);
    }
    CHECK_THAT(margin > in->inverse->valid_count / 20, "%zu texels of margin", margin);
    image_release(&color);
    image_release(&roughness);
    image_release(&emission);
    image_release(&confidence);
}

static size_t occurrences(const char *text, const char *part) {
    size_t count = 0;
    for (const char *at = strstr(text, part); at; at = strstr(at + 1, part))
        count++;
    return count;
}

/* The mean base colour of a segment is that of what photographs show of it: what was filled in has no say. */
static void test_means(const cJSON *segments, const struct export_input *in) {
    double sum = 0.0, count = 0.0;
    for (size_t i = 0; i < in->inverse->valid_count; i++) {
        uint32_t texel = in->inverse->valid[i];
        if (in->segments->of_triangle[in->inverse->triangle[texel]] != 0 || !(in->observation_count[texel] > 0.0f))
            continue;
        sum += (double)in->materials->base_color.texel[texel][1];
        count += 1.0;
    }
    const cJSON *mean = cJSON_GetObjectItem(cJSON_GetArrayItem(segments, 0), "mean_base_color");
    CHECK(count > 0.0);
    CHECK_NEAR(cJSON_GetNumberValue(cJSON_GetArrayItem(mean, 1)), sum / count, 1e-6);
}

static void test_report(const char *dir, const struct export_input *in) {
    struct error err;
    struct buf page;
    cJSON *report = NULL;
    char *path = file_join(dir, "report.json");
    CHECK(json_read(path, 1 << 24, &report, &err) == STATUS_OK);
    CHECK(cJSON_GetArraySize(cJSON_GetObjectItem(report, "segments")) == (int)in->segments->count);
    test_means(cJSON_GetObjectItem(report, "segments"), in);
    CHECK(cJSON_GetArraySize(cJSON_GetObjectItem(report, "files")) == 21);
    CHECK(cJSON_GetNumberValue(cJSON_GetObjectItem(report, "seed")) == 1.0);
    CHECK(cJSON_GetNumberValue(cJSON_GetArrayItem(cJSON_GetObjectItem(report, "offset"), 1)) == in->mesh->offset[1]);
    cJSON_Delete(report);
    mem_free(path);
    path = file_join(dir, "report.html");
    buf_init(&page, 1 << 26);
    CHECK(file_read(path, &page, &err) == STATUS_OK);
    const char *text = buf_text(&page);
    CHECK(strstr(text, "room &lt;1&gt; &amp; &quot;2&quot;") != NULL);
    CHECK(strstr(text, "<1>") == NULL);
    CHECK(strstr(text, "http") == NULL && strstr(text, "src=\"data:image/png") != NULL);
    CHECK(occurrences(text, "<img") == 6);
    CHECK(occurrences(text, "<svg") == 1 && occurrences(text, "</svg>") == 1);
    CHECK(occurrences(text, "<table>") == occurrences(text, "</table>"));
    CHECK(occurrences(text, "<figure>") == occurrences(text, "</figure>"));
    buf_release(&page);
    mem_free(path);
}

static void test_mesh(const char *dir, const struct mesh *wanted) {
    struct mesh mesh;
    struct error err;
    char *path = file_join(dir, "scene.ply");
    enum status status = mesh_file_read(path, "scene.ply", 1 << 20, &mesh, NULL, &err);
    CHECK_THAT(status == STATUS_OK, "%s", err.message);
    CHECK(mesh.triangle_count == wanted->triangle_count && mesh.normal != NULL);
    CHECK(memcmp(mesh.offset, wanted->offset, sizeof mesh.offset) == 0);
    for (size_t t = 0; t < mesh.triangle_count; t++)
        for (int k = 0; k < 3; k++)
            CHECK(memcmp(&mesh.position[mesh.index[t][k]], &wanted->position[wanted->index[t][k]], sizeof(vec3)) == 0);
    mesh_release(&mesh);
    mem_free(path);
}

/* views.json reads back as the camera that it was made from. */
static void test_views(const char *dir, const double offset[3], const struct camera *wanted) {
    struct error err;
    struct findings findings = {.problems = cJSON_CreateArray()};
    struct frames transforms;
    struct camera camera = {0};
    cJSON *tree = NULL;
    char *path = file_join(dir, "views.json");
    CHECK(json_read(path, 1 << 20, &tree, &err) == STATUS_OK);
    transforms_read(tree, "views.json", &transforms, &findings);
    CHECK(findings.problem_count == 0 && transforms.frame_count == 1);
    CHECK(frame_camera(&transforms.frame[0], wanted->width, wanted->height, offset, &camera, &err) == STATUS_OK);
    CHECK_STRING(transforms.frame[0].file, "images/003.exr");
    CHECK(camera.model == wanted->model && camera.fx == wanted->fx && camera.fy == wanted->fy);
    CHECK(camera.cx == wanted->cx && camera.cy == wanted->cy);
    CHECK(memcmp(camera.k, wanted->k, sizeof camera.k) == 0);
    CHECK(memcmp(camera.p, wanted->p, sizeof camera.p) == 0);
    for (int i = 0; i < 9; i++)
        CHECK_NEAR(camera.world_from_camera.rotation[i / 3][i % 3], wanted->world_from_camera.rotation[i / 3][i % 3],
                   1e-6);
    CHECK(camera.world_from_camera.translation.z == 3.0f);
    frames_release(&transforms);
    cJSON_Delete(findings.problems);
    findings_release(&findings);
    cJSON_Delete(tree);
    mem_free(path);
}

/* Distant light adds two files and a preview, in which what was filled in is dimmed. */
static void test_environment(const char *dir, struct export_input *in, struct announced *heard) {
    static const char *const known_names[] = {"count", "spread"};
    struct image map, known, back;
    struct error err;
    image_init_rgb(&map, 8, 4);
    image_init(&known, 8, 4, 2, known_names);
    for (int i = 0; i < 32; i++) {
        for (int c = 0; c < 3; c++)
            map.pixel[3 * i + c] = i == 9 ? 1e5f : 3.0f; /* a sun beyond half precision */
        known.pixel[2 * i] = i < 16 ? 2.0f : 0.0f;
    }
    int outputs = heard->outputs, previews = heard->previews;
    in->environment = &map, in->environment_confidence = &known;
    CHECK(export_outputs(dir, in, hear, heard, &err) == STATUS_OK);
    CHECK(heard->outputs == 2 * outputs + 2 && heard->previews == 2 * previews + 1);
    read_back(dir, "environment.exr", &back);
    CHECK(back.width == 8 && back.channel_count == 3 && memcmp(back.pixel, map.pixel, 32 * 3 * sizeof *map.pixel) == 0);
    image_release(&back);
    read_back(dir, "environment_confidence.exr", &back);
    CHECK(back.pixel[0] == 2.0f && back.pixel[2 * 31] == 0.0f);
    image_release(&back);
    read_back(dir, "preview/environment.png", &back);
    CHECK(back.width == 8 && back.pixel[0] > 1.2f * back.pixel[3 * 31] && back.pixel[3 * 31] > 0.0f);
    CHECK(back.pixel[3 * 9] == 1.0f);
    image_release(&back);
    in->environment = in->environment_confidence = NULL;
    image_release(&map);
    image_release(&known);
}

/* Off the axes, with a lens. */
static struct camera make_camera(void) {
    struct camera camera = {.width = 16,
                            .height = 12,
                            .fx = 20.0f,
                            .fy = 21.0f,
                            .cx = 8.0f,
                            .cy = 6.5f,
                            .k = {0.1f, -0.02f},
                            .p = {0.001f, 0.002f}};
    camera.world_from_camera = (struct rigid){{{0, 0, 1}, {1, 0, 0}, {0, 1, 0}}, {1.0f, 2.0f, 3.0f}};
    camera.camera_from_world = rigid_inverse(&camera.world_from_camera);
    return camera;
}

/* How many photographs show each texel; what none shows is filled in white. The caller's. */
static float *make_counts(struct room *room) {
    size_t texels = (size_t)room->atlas.width * room->atlas.height;
    float *count = mem_calloc(texels, sizeof *count);
    for (size_t i = 0; i < texels; i++)
        count[i] = (float)(i % 9);
    for (size_t i = 0; i < room->inverse.valid_count; i++)
        for (int c = 0; c < 3 && count[room->inverse.valid[i]] == 0.0f; c++)
            room->materials.base_color.texel[room->inverse.valid[i]][c] = 1.0f;
    return count;
}

/* Previews, as more becomes known: without and with the mesh there, with counts of photographs. */
static void test_previews(const char *dir, struct export_input *in, const float *count, struct materials *materials) {
    struct announced heard = {.dir = dir};
    struct error err;
    CHECK(export_preview(dir, in, hear, &heard, &err) == STATUS_OK);
    CHECK(heard.previews == 5 && heard.outputs == 0); /* with the mesh, no confidence yet */
    heard = (struct announced){.dir = dir};
    CHECK(export_preview(dir, in, hear, &heard, &err) == STATUS_OK && heard.previews == 4); /* the mesh is there */
    in->observation_count = count;
    materials_start_deviation(materials);
    CHECK(export_preview(dir, in, hear, &heard, &err) == STATUS_OK && heard.previews == 8); /* nothing is known of it */
}

int main(void) {
    char dir[] = "/tmp/unbake-export-XXXXXX";
    struct parallel *pool = parallel_new(1);
    struct room room;
    struct error err;
    CHECK(mkdtemp(dir) != NULL);
    CHECK(room_init(&room, &(struct room_look){256, 15.0f, 15.0f, ROOM_LAMPS_FRAMED}, pool, &err) == STATUS_OK);
    memcpy(room.mesh.offset, (double[3]){500000.0, -4100000.0, 0.0}, sizeof room.mesh.offset);
    size_t texels = (size_t)room.atlas.width * room.atlas.height;
    float *count = make_counts(&room);
    bool is_emitter[ROOM_OBJECT_COUNT] = {[ROOM_WALL_EMITTER] = true, [ROOM_CEILING_EMITTER] = true};
    struct image photograph;
    image_init_rgb(&photograph, 16, 12);
    struct camera camera = make_camera();
    struct export_comparison comparison = {"images/003.exr", &photograph, &photograph, &camera};
    cJSON *report = NULL;
    static const char text[] = "{\"seed\":1,\"stages\":[{\"name\":\"refine\",\"seconds\":2.5}],"
                               "\"series\":{\"loss\":[[0,1],[1,0.5],[2,0.02]],\"one\":[[0,1]]},"
                               "\"views\":[{\"name\":\"a\",\"msre\":0.01}],\"settings\":{\"a\":1,\"seed\":7}}";
    CHECK(json_parse(text, strlen(text), "report", &report, &err) == STATUS_OK);
    struct export_input in = {.title = "room <1> & \"2\"",
                              .mesh = &room.mesh,
                              .segments = &room.segments,
                              .atlas = &room.atlas,
                              .inverse = &room.inverse,
                              .materials = &room.materials,
                              .is_emitter = is_emitter,
                              .comparison_count = 1,
                              .comparison = &comparison,
                              .report = report,
                              .up = {0.0f, 1.0f, 0.0f},
                              .has_materials = true};

    test_previews(dir, &in, count, &room.materials);
    for (size_t i = 0; i < texels; i++)
        room.materials.deviation[i] = image_half_from_float(0.1f);
    struct announced heard = {.dir = dir};
    enum status status = export_outputs(dir, &in, hear, &heard, &err);
    CHECK_THAT(status == STATUS_OK, "%s", err.message);
    CHECK_THAT(heard.previews == 5 && heard.outputs == 18, "%d, %d", heard.previews, heard.outputs);
    CHECK_STRING(heard.last, "report.html");
    test_headers(dir);
    test_textures(dir, &in);
    test_mesh(dir, &room.mesh);
    test_views(dir, room.mesh.offset, &camera);
    test_report(dir, &in);
    test_environment(dir, &in, &heard);
    heard.refuse = true;
    CHECK(export_outputs(dir, &in, hear, &heard, &err) == STATUS_CANCELLED);

    cJSON_Delete(report);
    image_release(&photograph);
    mem_free(count);
    room_release(&room);
    CHECK(file_remove_tree(dir, NULL) == STATUS_OK);
    parallel_free(pool);
    return check_result();
}
