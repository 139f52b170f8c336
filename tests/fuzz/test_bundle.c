/* test_bundle.c -- a whole bundle: transforms.json as it comes, beside a mesh and two pictures. */
#include "server/ingest/bundle.h"
#include "server/ingest/facts.h"

#include <sys/stat.h>

#include "common/file.h"
#include "common/image.h"
#include "common/mem.h"
#include "tests/fuzz/fuzz.h"

static const char mesh[] =
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 2\nproperty list uchar int vertex_index\nend_header\n"
    "0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n";

static char *dir;
static struct parallel *pool;

static void put(const char *name, const void *data, size_t size) {
    char *path = file_join(dir, name);
    fuzz_write(path, data, size);
    mem_free(path);
}

static void start(void) {
    struct image image;
    dir = file_join(fuzz_folder(), "bundle");
    MUST(file_make_dirs(dir, NULL) == STATUS_OK);
    put("mesh.ply", mesh, sizeof mesh - 1);
    put("points.ply", "ply\nformat ascii 1.0\nelement vertex 0\nend_header\n", 50);
    image_init_rgb(&image, 16, 12);
    char *png = file_join(dir, "a.png"), *exr = file_join(dir, "b.exr");
    MUST(image_write_png(png, &image, 1.0f, NULL) == STATUS_OK);
    MUST(image_write_exr(exr, &image, IMAGE_HALF, false, NULL) == STATUS_OK);
    mem_free(png);
    mem_free(exr);
    image_release(&image);
    pool = parallel_new(1);
}

/* It goes to the daemon as a line of JSON. */
static void check_json(const cJSON *value) {
    cJSON *again = NULL;
    char *text = json_text(value);
    MUST(json_parse(text, strlen(text), "a report", &again, NULL) == STATUS_OK);
    cJSON_Delete(again);
    mem_free(text);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static const struct bundle_limits limits = {
        .file_count = 100, .total_bytes = 1 << 20, .ratio = 100.0, .photograph_pixels = 1 << 20, .triangles = 1000};
    struct scene scene;
    struct error err = {.message = ""};
    if (!pool)
        start();
    put(BUNDLE_TRANSFORMS, data, size);
    cJSON *problems = cJSON_CreateArray();
    enum status status = bundle_load(dir, NULL, &limits, pool, &scene, problems, &err);
    MUST((status == STATUS_OK) == (cJSON_GetArraySize(problems) == 0));
    if (status == STATUS_OK) {
        MUST(scene.photograph_count > 0);
        cJSON *facts = facts_of(&scene);
        check_json(facts);
        cJSON_Delete(facts);
    } else {
        MUST(status == STATUS_INPUT && err.message[0] != '\0');
    }
    check_json(problems);
    scene_release(&scene);
    cJSON_Delete(problems);
    return 0;
}

#define POSE "\"transform_matrix\":[[1,0,0,0],[0,1,0,0],[0,0,1,3],[0,0,0,1]]"

void fuzz_seeds(struct seeds *s) {
    s->mutants = 500;
    seeds_text(s, "{\"w\":16,\"h\":12,\"fl_x\":20,\"cx\":8,\"cy\":6,\"k1\":-0.1,\"frames\":["
                  "{\"file_path\":\"a.png\",\"exposure_time\":0.01,\"iso\":100,\"mask_path\":\"a.png\"," POSE "},"
                  "{\"file_path\":\"./b.exr\",\"exposure\":0.5,\"split\":\"test\"," POSE "}]}");
    seeds_text(s, "{\"camera_model\":\"OPENCV_FISHEYE\",\"camera_angle_x\":1.5,\"mesh\":\"mesh.ply\","
                  "\"ply_file_path\":\"points.ply\",\"train_filenames\":[\"a.png\"],\"frames\":["
                  "{\"file_path\":\"a.png\"," POSE "},{\"file_path\":\"gone.png\"," POSE "}]}");
}
