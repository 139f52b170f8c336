/* tiny_scene.h -- a scene of two triangles and three photographs of 8 x 8 pixels, and one job on it, called in this
 * process: what the worker's tests run again and again. A fourth frame has no photograph and is left out. */
#ifndef UNBAKE_TESTS_UNIT_TINY_SCENE_H
#define UNBAKE_TESTS_UNIT_TINY_SCENE_H

#include "common/file.h"
#include "common/image.h"
#include "common/json.h"
#include "common/mem.h"
#include "server/worker/tasks.h"
#include "tests/check.h"

#define OK(call) CHECK_THAT((call) == STATUS_OK, "%s", err.message)

#define TINY_FRAME(name) "{\"file_path\":\"" name "\",\"transform_matrix\":[[1,0,0,0.3],[0,1,0,0.3],[0,0,1,1]]}"
#define TINY_MESH "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 4 3\n"
/* Without braces: more may follow. */
#define TINY_SETTINGS                                                                                                  \
    "\"texture_size\":64,\"texels_per_metre\":16,\"iterations\":1,\"texels_per_iteration\":64,"                        \
    "\"cameras_per_texel\":1,\"samples_per_camera\":2,\"report_samples\":1,"                                           \
    "\"gather_samples\":16,\"gloss_passes\":1,\"preview_interval_sec\":60"

static struct error err;
static char dir[64]; /* the job's folder; in memory where possible: much is made sure to be on disk */
static char *scene;  /* its files */
static struct progress silent = {.fd = -1};

static inline void put(const char *name, const char *text) {
    char *path = mem_printf("%s/%s", dir, name);
    OK(file_replace(path, text, strlen(text), &err));
    mem_free(path);
}

/* Makes the folder, and the scene in it; tiny_scene_remove is its end. */
static inline void tiny_scene_make(const char *test) {
    static const char *const names[] = {"a", "b", "c"};
    snprintf(dir, sizeof dir, "%s/unbake-%s-XXXXXX", check_fast_dir(), test);
    if (!mkdtemp(dir))
        exit(1);
    scene = file_join(dir, "scene");
    OK(file_make_dirs(scene, &err));
    put("scene/room.obj", TINY_MESH);
    for (int i = 0; i < 3; i++) {
        struct image image;
        char *path = mem_printf("%s/%s.png", scene, names[i]);
        image_init_rgb(&image, 8, 8);
        for (size_t k = 0; k < 192; k++)
            image.pixel[k] = 0.25f + 0.001f * (float)(k % 7);
        OK(image_write_png(path, &image, 1.0f, &err));
        image_release(&image);
        mem_free(path);
    }
    put("scene/transforms.json",
        "{\"fl_x\":8,\"frames\":[" TINY_FRAME("a") "," TINY_FRAME("b") "," TINY_FRAME("c") "," TINY_FRAME("d") "]}");
}

static inline void tiny_scene_remove(void) {
    OK(file_remove_tree(dir, &err));
    mem_free(scene);
}

static inline enum status reconstruct(const char *settings, const char *from, const char *reduced) {
    cJSON *json = cJSON_Parse(settings);
    struct order order = {.dir = dir,
                          .kind = "reconstruct",
                          .thread_count = 1,
                          .scene = from,
                          .scene_id = "x",
                          .name = "",
                          .reduced = reduced,
                          .settings = json};
    err = (struct error){0};
    enum status status = task_reconstruct(&order, &silent, &err);
    cJSON_Delete(json);
    return status;
}

/* report.json of the job that ran last; the caller's. */
static inline cJSON *read_report(void) {
    cJSON *json = NULL;
    char *path = mem_printf("%s/out/report.json", dir);
    OK(json_read(path, 1 << 20, &json, &err));
    mem_free(path);
    return json;
}

#endif
