/* test_colmap.c -- COLMAP's files of cameras and images. The first byte of the input chooses text or
 * binary and which of the two it is; the other is a good one. */
#include "server/ingest/source/colmap_images.h"

#include "common/mem.h"
#include "tests/fuzz/fuzz.h"

#define CAMERAS                                                                                                        \
    "# x\n1 PINHOLE 64 48 50 51 32 24\n2 FULL_OPENCV 64 48 50 50 32 24 -0.1 0.02 0.001 -0.002 0.1 0 0 0\n"             \
    "3 SIMPLE_RADIAL_FISHEYE 64 48 50 32 24 0.01\r\n"
#define IMAGES "# x\n\n1 1 0 0 0 0 0 0 1 a b.png\n1 2 -1 3 4 5\n2 0.5 -0.5 0.5 0.5 1 2 3 3 c/d.jpg\n\n"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    struct findings f = {.problems = cJSON_CreateArray()};
    struct frames t = {0};
    struct error err = {.message = ""};
    bool binary = size > 0 && (data[0] & 1), is_images = size > 0 && (data[0] & 2);
    const uint8_t *rest = size > 0 ? data + 1 : data;
    size_t length = size > 0 ? size - 1 : 0;
    struct colmap_cameras *c = is_images ? colmap_cameras_parse(CAMERAS, sizeof CAMERAS - 1, "cameras", false, &err)
                                         : colmap_cameras_parse(rest, length, "cameras", binary, &err);
    if (c) {
        enum status status = is_images
                                 ? colmap_images_parse(rest, length, "images", binary, c, "images/", &t, &f, &err)
                                 : colmap_images_parse(IMAGES, sizeof IMAGES - 1, "images", false, c, "", &t, &f, &err);
        MUST(status == STATUS_OK || (status == STATUS_INPUT && err.message[0] != '\0'));
        MUST(t.frame_count <= t.named_count);
        for (size_t i = 0; i < t.frame_count; i++) {
            struct camera camera;
            MUST(t.frame[i].file[0] != '\0' && isfinite(t.frame[i].world_from_camera.translation[0]));
            frame_camera(&t.frame[i], 64, 48, (double[3]){1e6}, &camera, &err);
        }
    } else {
        MUST(err.status == STATUS_INPUT && err.message[0] != '\0');
    }
    colmap_cameras_free(c);
    frames_release(&t);
    cJSON_Delete(f.problems);
    findings_release(&f);
    return 0;
}

static size_t put(uint8_t *at, const void *value, size_t bytes) {
    memcpy(at, value, bytes);
    return bytes;
}

static void add_binary(struct seeds *s) {
    static const uint64_t count = 1, width = 64, height = 48, points = 1;
    static const uint32_t id = 1, opencv = 4;
    static const double parameters[8] = {50, 50, 32, 24, -0.1, 0, 0, 0}, pose[7] = {1, 0, 0, 0, 1, 2, 3}, point[3];
    uint8_t file[256] = {1};
    size_t used = 1;
    used += put(file + used, &count, 8);
    used += put(file + used, &id, 4);
    used += put(file + used, &opencv, 4);
    used += put(file + used, &width, 8);
    used += put(file + used, &height, 8);
    used += put(file + used, parameters, sizeof parameters);
    seeds_add(s, file, used);
    file[0] = 3;
    used = 1;
    used += put(file + used, &count, 8);
    used += put(file + used, &id, 4);
    used += put(file + used, pose, sizeof pose);
    used += put(file + used, &id, 4);
    used += put(file + used, "a.png", 6);
    used += put(file + used, &points, 8);
    used += put(file + used, point, sizeof point);
    seeds_add(s, file, used);
}

void fuzz_seeds(struct seeds *s) {
    s->mutants = 10000;
    seeds_text(s, "0" CAMERAS);
    seeds_text(s, "01 FOV 64 48 50 51 32 24 0.9\n2 THIN_PRISM_FISHEYE 64 48 50 51 32 24 .1 0 .01 .02 0 0 .003 .004\n");
    seeds_text(s, "2" IMAGES);
    add_binary(s);
}
