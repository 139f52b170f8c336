/* test_transforms.c -- transforms.json, damaged: as text, for the JSON reader, and as values of the
 * wrong kind in every place, for what reads the tree. Cameras that come out must project without
 * a fault. */
#include "server/ingest/transforms.h"

#include <math.h>

#include "tests/fuzz/fuzz.h"

static const char opencv[] =
    "{\"camera_model\":\"OPENCV\",\"w\":64,\"h\":48,\"fl_x\":50.5,\"fl_y\":51,\"cx\":32,\"cy\":24,"
    "\"k1\":-0.1,\"k2\":0.02,\"k6\":1e-3,\"p1\":0.001,\"p2\":-0.002,\"mesh\":\"mesh.ply\","
    "\"ply_file_path\":\"sparse.ply\",\"test_filenames\":[\"./b.png\"],\"frames\":["
    "{\"file_path\":\"a.png\",\"exposure_time\":0.01,\"iso\":100,\"f_number\":2.8,"
    "\"transform_matrix\":[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]},"
    "{\"file_path\":\"./b.png\",\"exposure\":0.5,\"mask_path\":\"m.png\",\"split\":\"val\","
    "\"transform_matrix\":[[0,-1,0,1e3],[1,0,0,-2],[0,0,1,0.5]]},"
    "{\"file_path\":\"sub\\\\c.png\",\"is_fisheye\":true,\"camera_angle_x\":2.5,\"k4\":0.3,"
    "\"transform_matrix\":[[0.6,0.8,0,0],[-0.8,0.6,0,0],[0,0,1,0],[0,0,0,1]]}]}";
static const char prism[] = "{\"camera_model\":\"THIN_PRISM_FISHEYE\",\"fl_x\":50,\"k1\":0.1,\"p1\":0.01,\"sx1\":0.02,"
                            "\"frames\":[{\"file_path\":\"a\",\"camera_model\":\"fov\",\"omega\":0.9,"
                            "\"transform_matrix\":[[1,0,0,0],[0,1,0,0],[0,0,1,0]]},{\"file_path\":\"b\",\"k4\":-0.2,"
                            "\"transform_matrix\":[[1,0,0,9e5],[0,1,0,0],[0,0,1,0]]}]}";
static const char fisheye[] = "{\"camera_model\":\"OPENCV_FISHEYE\",\"camera_angle_x\":1.5,\"k1\":-0.4,\"frames\":["
                              "{\"file_path\":\"a\",\"transform_matrix\":[[1,0,0,0],[0,1,0,0],[0,0,1,0]]}]}";

static void check_frame(const struct frame *frame) {
    struct camera camera;
    struct error err = {.message = ""};
    const char *file = frame->file;
    MUST(file[0] != '\0' && file[0] != '/' && strncmp(file, "../", 3) != 0 && !strstr(file, "/../"));
    if (frame_camera(frame, 64, 48, (double[3]){0.0}, &camera, &err) != STATUS_OK) {
        MUST(err.message[0] != '\0');
        return;
    }
    float x, y, depth_m;
    vec3 direction;
    if (camera_project(&camera, vec3_make(0.1f, 0.2f, -3.0f), &x, &y, &depth_m))
        MUST(x >= 0.0f && x < 64.0f && y >= 0.0f && y < 48.0f);
    if (camera_direction(&camera, 10.0f, 40.0f, &direction))
        MUST(fabsf(vec3_length(direction) - 1.0f) < 1e-4f);
}

static void read_tree(const cJSON *tree) {
    struct findings f = {.problems = cJSON_CreateArray()};
    struct frames t;
    transforms_read(tree, "case", &t, &f);
    for (size_t i = 0; i < t.frame_count; i++)
        check_frame(&t.frame[i]);
    MUST((size_t)cJSON_GetArraySize(f.problems) <= FINDINGS_MAX);
    frames_release(&t);
    cJSON_Delete(f.problems);
    findings_release(&f);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    cJSON *tree = NULL;
    struct error err = {.message = ""};
    if (json_parse((const char *)data, size, "case", &tree, &err) == STATUS_OK)
        read_tree(tree);
    else
        MUST(tree == NULL && err.message[0] != '\0');
    cJSON_Delete(tree);
    return 0;
}

/* Seeds with each of the odd values in the place of `node`'s every child, and below. */
static void replace_all(struct seeds *s, cJSON *root, cJSON *node) {
    static const char *const odd[] = {"null",  "true",  "\"\"", "\"..\"", "-1", "0",
                                      "1e999", "1e300", "[]",   "[[]]",   "{}", "[1,2,3,4]"};
    for (cJSON *child = node->child; child; child = child->next) {
        replace_all(s, root, child);
        for (size_t k = 0; k < sizeof odd / sizeof *odd; k++) {
            cJSON *value = cJSON_Parse(odd[k]), kept = *child;
            child->type = value->type;
            child->valuestring = value->valuestring;
            child->valuedouble = value->valuedouble;
            child->child = value->child;
            char *text = json_text(root);
            seeds_text(s, text);
            free(text);
            *child = kept;
            cJSON_Delete(value);
        }
    }
}

void fuzz_seeds(struct seeds *s) {
    static const char *const texts[] = {opencv, fisheye, prism};
    s->mutants = 5000;
    seeds_data(s, "conformance/room_transforms.json", "");
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        cJSON *tree = cJSON_Parse(texts[i]);
        seeds_text(s, texts[i]);
        replace_all(s, tree, tree);
        cJSON_Delete(tree);
    }
}
