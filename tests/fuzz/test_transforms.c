/* test_transforms.c -- transforms.json, damaged: as text, for the JSON reader, and as values of the
 * wrong kind, for what reads the tree. Cameras that come out must project without a fault. */
#include "server/ingest/transforms.h"

#include "tests/fuzz/mutate.h"

static void target(const uint8_t *data, size_t size) {
    cJSON *tree = NULL;
    struct error err = {.message = ""};
    if (json_parse((const char *)data, size, "case", &tree, &err) != STATUS_OK) {
        CHECK(tree == NULL && err.message[0] != '\0');
        return;
    }
    struct findings f = {.problems = cJSON_CreateArray()};
    struct transforms t;
    transforms_read(tree, "case", &t, &f);
    for (size_t i = 0; i < t.frame_count; i++) {
        struct camera camera;
        const char *file = t.frame[i].file;
        CHECK(file[0] != '\0' && file[0] != '/' && strncmp(file, "../", 3) != 0 && !strstr(file, "/../"));
        if (transforms_camera(&t.frame[i], 64, 48, &camera, &err) != STATUS_OK) {
            CHECK(err.message[0] != '\0');
            continue;
        }
        float x, y, depth_m;
        vec3 direction;
        if (camera_project(&camera, vec3_make(0.1f, 0.2f, -3.0f), &x, &y, &depth_m))
            CHECK(x >= 0.0f && x < 64.0f && y >= 0.0f && y < 48.0f);
        if (camera_direction(&camera, 10.0f, 40.0f, &direction))
            CHECK_NEAR(vec3_length(direction), 1.0, 1e-4);
    }
    CHECK((size_t)cJSON_GetArraySize(f.problems) <= FINDINGS_MAX);
    transforms_release(&t);
    cJSON_Delete(f.problems);
    findings_release(&f);
    cJSON_Delete(tree);
}

int main(int argc, char **argv) {
    static const char text[] =
        "{\"camera_model\":\"OPENCV\",\"w\":64,\"h\":48,\"fl_x\":50.5,\"fl_y\":51,\"cx\":32,\"cy\":24,"
        "\"k1\":-0.1,\"k2\":0.02,\"k6\":1e-3,\"p1\":0.001,\"p2\":-0.002,\"mesh\":\"mesh.ply\","
        "\"ply_file_path\":\"sparse.ply\",\"test_filenames\":[\"./b.png\"],\"frames\":["
        "{\"file_path\":\"a.png\",\"exposure_time\":0.01,\"iso\":100,\"f_number\":2.8,"
        "\"transform_matrix\":[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]},"
        "{\"file_path\":\"./b.png\",\"exposure\":0.5,\"mask_path\":\"m.png\",\"split\":\"val\","
        "\"transform_matrix\":[[0,-1,0,1e3],[1,0,0,-2],[0,0,1,0.5]]},"
        "{\"file_path\":\"sub\\\\c.png\",\"is_fisheye\":true,\"camera_angle_x\":2.5,\"k4\":0.3,"
        "\"transform_matrix\":[[0.6,0.8,0,0],[-0.8,0.6,0,0],[0,0,1,0],[0,0,0,1]]}]}";
    static const char fisheye[] =
        "{\"camera_model\":\"OPENCV_FISHEYE\",\"camera_angle_x\":1.5,\"k1\":-0.4,\"frames\":[{\"file_path\":\"a\","
        "\"transform_matrix\":[[1,0,0,0],[0,1,0,0],[0,0,1,0]]}]}";
    struct mutate *m = malloc(sizeof *m);
    mutate_init(m);
    mutate_add(m, "vectors/json-suite", ".json");
    mutate_add(m, "conformance/room_transforms.json", "");
    for (int i = 0; i < 100; i++) { /* so that the suite's many files do not drown them */
        mutate_add_bytes(m, text, sizeof text - 1);
        mutate_add_bytes(m, fisheye, sizeof fisheye - 1);
    }
    int result = mutate_run(m, argc, argv, 20000, target);
    free(m);
    return result;
}
