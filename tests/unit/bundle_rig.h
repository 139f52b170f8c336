/* bundle_rig.h -- a small good bundle in a folder, and what is said of it. */
#ifndef UNBAKE_TESTS_UNIT_BUNDLE_RIG_H
#define UNBAKE_TESTS_UNIT_BUNDLE_RIG_H

#include <sys/stat.h>

#include "common/file.h"
#include "common/image.h"
#include "common/mem.h"
#include "server/ingest/bundle.h"
#include "tests/check.h"

static char work[64]; /* in memory where possible: unpacking syncs the file system */
static struct parallel *pool;

#define POSE "\"transform_matrix\":[[1,0,0,0.5],[0,1,0,0.5],[0,0,1,2],[0,0,0,1]]"
#define LENS "\"w\":8,\"h\":6,\"fl_x\":7,\"fl_y\":7.5,\"cx\":4,\"cy\":3"
#define FRAME(name) "{\"file_path\":\"" name "\"," POSE "}"
#define OTHER_POSE "\"transform_matrix\":[[1,0,0,0.5],[0,1,0,0.5],[0,0,1,2.001],[0,0,0,1]]"
#define FRAME_ELSEWHERE(name) "{\"file_path\":\"" name "\"," OTHER_POSE "}"
#define THREE FRAME("a.exr") "," FRAME("./b.png") "," FRAME("c.exr")
#define TOP(extra) "{" LENS "," extra "\"frames\":[" THREE "]}"
#define MESH                                                                                                           \
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"                  \
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
#define TURNED                                                                                                         \
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"                  \
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 2 1\n"
#define OBJ "v 0 0 0\nv 1 0 0\nv 0 1 0\no a\nf 1 2 3\no b\nf 1 3 2\n"
#define CLOUD                                                                                                          \
    "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"                  \
    "end_header\n0 0 0\n"

static inline void put(const char *name, const char *text) {
    char *path = file_join(work, name);
    CHECK(file_replace(path, text, strlen(text), NULL) == STATUS_OK);
    mem_free(path);
}

static inline bool make_folder(const char *name) {
    char *path = file_join(work, name);
    bool made = mkdir(path, 0700) == 0;
    mem_free(path);
    return made;
}

static inline void put_picture(const char *name, uint32_t width, uint32_t height, float value, bool exr) {
    struct image image;
    image_init_rgb(&image, width, height);
    for (size_t i = 0; i < (size_t)width * height * 3; i++)
        image.pixel[i] = value;
    char *path = file_join(work, name);
    CHECK((exr ? image_write_exr(path, &image, IMAGE_FLOAT, false, NULL) : image_write_png(path, &image, 1.0f, NULL)) ==
          STATUS_OK);
    mem_free(path);
    image_release(&image);
}

static inline void put_good(void) {
    CHECK(file_remove_tree(work, NULL) == STATUS_OK && mkdir(work, 0700) == 0);
    put("mesh.ply", MESH);
    put_picture("a.exr", 8, 6, 2.5f, true);
    put_picture("b.png", 8, 6, 0.5f, false);
    put_picture("c.exr", 8, 6, 2.5f, true);
    put("transforms.json", "{" LENS ",\"frames\":[" THREE "]}");
}

static inline enum status load(struct scene *scene, cJSON **problems, struct error *err) {
    struct bundle_limits limits = bundle_default_limits();
    limits.photograph_pixels = 1000000;
    *problems = cJSON_CreateArray();
    *err = (struct error){.message = ""};
    enum status status = bundle_load(work, NULL, &limits, pool, scene, *problems, err);
    if (status != STATUS_OK)
        scene_release(scene);
    return status;
}

static inline void bundle_rig_begin(void) {
    snprintf(work, sizeof work, "%s/unbake-test-bundle-XXXXXX", check_fast_dir());
    CHECK(mkdtemp(work) != NULL);
    pool = parallel_new(2);
}

static inline void bundle_rig_end(void) {
    parallel_free(pool);
    file_remove_tree(work, NULL);
}

#endif
