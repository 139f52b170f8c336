/* outputs.c: more segments than a file of objects may have. */
#include "common/json.h"
#include "tests/unit/export_rig.h"

/* Triangles side by side, each an object of its own. */
static struct mesh make_pieces(uint32_t count) {
    enum { PER_ROW = 128 };
    struct mesh mesh = {.vertex_count = 3 * (size_t)count, .triangle_count = count, .face_count = count};
    mesh.position = mem_array(mesh.vertex_count, sizeof *mesh.position);
    mesh.index = mem_array(count, sizeof *mesh.index);
    mesh.face = mem_array(count, sizeof *mesh.face);
    mesh.object_id = mem_array(count, sizeof *mesh.object_id);
    for (uint32_t t = 0; t < count; t++) {
        vec3 corner = {(float)(t % PER_ROW), (float)(t / PER_ROW), 0.0f};
        mesh.position[3 * t] = corner;
        mesh.position[3 * t + 1] = vec3_add(corner, (vec3){0.9f, 0.0f, 0.0f});
        mesh.position[3 * t + 2] = vec3_add(corner, (vec3){0.0f, 0.9f, 0.0f});
        for (uint32_t k = 0; k < 3; k++)
            mesh.index[t][k] = 3 * t + k;
        mesh.face[t] = t;
        mesh.object_id[t] = t;
    }
    return mesh;
}

/* More segments than a file of objects may have. */
static void test_left_out(const char *dir, struct parallel *pool) {
    enum { COUNT = 16385 };
    struct mesh mesh = make_pieces(COUNT);
    struct segments segments;
    struct atlas atlas;
    struct inverse_uv inverse;
    struct materials materials;
    struct error err;
    segments_from_object_id(&segments, &mesh);
    CHECK(atlas_make(&atlas, &mesh, &segments, 512, 0.0f, ATLAS_PADDING, &err) == STATUS_OK);
    inverse_uv_make(&inverse, &atlas, mesh.triangle_count, pool);
    materials_init(&materials, &inverse, segments.count, rgb_gray(0.5f), 0.5f, 0.5f);
    float *zero = mem_calloc((size_t)atlas.width * atlas.height, sizeof *zero);
    bool *is_emitter = mem_calloc(COUNT, sizeof *is_emitter);
    cJSON *report = cJSON_CreateObject(), *written = NULL;
    struct announced heard = {.dir = dir};
    char *path = file_join(dir, "report.json"), *old = file_join(dir, "scene.glb");
    CHECK(file_replace(old, "x", 1, &err) == STATUS_OK); /* of an earlier export into this folder */
    struct export_input in = {.title = "strips",
                              .has_materials = true,
                              .mesh = &mesh,
                              .segments = &segments,
                              .atlas = &atlas,
                              .inverse = &inverse,
                              .materials = &materials,
                              .observation_count = zero,
                              .is_emitter = is_emitter,
                              .report = report};
    CHECK_THAT(export_outputs(dir, &in, hear, &heard, &err) == STATUS_OK, "%s", err.message);
    CHECK(access(old, F_OK) != 0);
    CHECK(json_read(path, 1 << 24, &written, &err) == STATUS_OK);
    const cJSON *left_out = cJSON_GetObjectItem(written, "left_out"), *first = cJSON_GetArrayItem(left_out, 0);
    CHECK(cJSON_GetArraySize(left_out) == 7);
    CHECK_STRING(cJSON_GetStringValue(cJSON_GetObjectItem(first, "name")), "scene.glb");
    CHECK(strstr(cJSON_GetStringValue(cJSON_GetObjectItem(first, "reason")), "16385 segments"));
    CHECK_STRING(heard.last, "report.html");
    cJSON_Delete(written);
    cJSON_Delete(report);
    mem_free(old);
    mem_free(path);
    mem_free(is_emitter);
    mem_free(zero);
    materials_release(&materials);
    inverse_uv_release(&inverse);
    atlas_release(&atlas);
    segments_release(&segments);
    mesh_release(&mesh);
}

int main(void) {
    char dir[] = "/tmp/unbake-export-objects-XXXXXX";
    struct parallel *pool = parallel_new(1);
    CHECK(mkdtemp(dir) != NULL);
    test_left_out(dir, pool);
    CHECK(file_remove_tree(dir, NULL) == STATUS_OK);
    parallel_free(pool);
    return check_result();
}
