/* test_outputs_read_back.c -- an attempt of which one output was damaged on its way to the disk fails and says which: no
 * reader is left to find out. One byte of one file after the other changes between the worker and the system. */
#include <dlfcn.h>

#include "common/file.h"
#include "common/image.h"
#include "common/json.h"
#include "common/mem.h"
#include "server/worker/read_back.h"
#include "server/worker/tasks.h"
#include "tests/check.h"

static struct error err;
static char dir[64];
static char *scene;
static const char *damaged;            /* the end of the name of the file of which a byte changes */
static long damaged_at, damaged_count; /* which one; how often it did */

#define OK(call) CHECK_THAT((call) == STATUS_OK, "%s", err.message)

/* --- between the worker and the system -------------------------------------------------------------- */

static bool is_damaged(int fd) {
    char link[64], path[512];
    if (!damaged)
        return false;
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t length = readlink(link, path, sizeof path - 1);
    if (length < 0)
        return false;
    path[length] = '\0';
    char *part = strstr(path, ".part");
    if (!part)
        part = strstr(path, ".tmp");
    if (part)
        *part = '\0';
    size_t name = strlen(damaged), whole = strlen(path);
    return whole > name && strcmp(path + whole - name, damaged) == 0;
}

/* The bytes with the one changed that is to change; the caller's. */
static void *damage(const void *data, size_t length, long at) {
    unsigned char *copy = malloc(length + 1);
    memcpy(copy, data, length);
    if (at <= damaged_at && damaged_at < at + (long)length) {
        copy[damaged_at - at] ^= 0x10;
        damaged_count++;
    }
    return copy;
}

#define REAL(type, name, ...)                                                                                          \
    static type (*call)(__VA_ARGS__);                                                                                  \
    if (!call)                                                                                                         \
    *(void **)&call = dlsym(RTLD_NEXT, #name)

ssize_t pwrite(int fd, const void *data, size_t length, off_t at) {
    REAL(ssize_t, pwrite, int, const void *, size_t, off_t);
    if (!is_damaged(fd))
        return call(fd, data, length, at);
    void *copy = damage(data, length, at);
    ssize_t result = call(fd, copy, length, at);
    free(copy);
    return result;
}

ssize_t write(int fd, const void *data, size_t length) {
    REAL(ssize_t, write, int, const void *, size_t);
    if (!is_damaged(fd))
        return call(fd, data, length);
    void *copy = damage(data, length, lseek(fd, 0, SEEK_CUR));
    ssize_t result = call(fd, copy, length);
    free(copy);
    return result;
}

size_t fwrite(const void *data, size_t size, size_t count, FILE *file) {
    REAL(size_t, fwrite, const void *, size_t, size_t, FILE *);
    if (!is_damaged(fileno(file)))
        return call(data, size, count, file);
    void *copy = damage(data, size * count, ftell(file));
    size_t result = call(copy, size, count, file);
    free(copy);
    return result;
}

#undef fwrite_unlocked
size_t fwrite_unlocked(const void *data, size_t size, size_t count, FILE *file) {
    return fwrite(data, size, count, file);
}

/* --- a job ------------------------------------------------------------------------------------------- */

#define FRAME(name) "{\"file_path\":\"" name "\",\"transform_matrix\":[[1,0,0,0.3],[0,1,0,0.3],[0,0,1,1]]}"
#define MESH "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 4 3\n"
#define SETTINGS                                                                                                       \
    "{\"texture_size\":64,\"iterations\":1,\"texels_per_iteration\":64,\"cameras_per_texel\":1,"                       \
    "\"samples_per_camera\":2,\"report_samples\":1,\"preview_interval_sec\":60}"

static void put(const char *name, const char *text) {
    char *path = mem_printf("%s/%s", dir, name);
    OK(file_replace(path, text, strlen(text), &err));
    mem_free(path);
}

static void put_scene(void) {
    static const char *const names[] = {"a", "b", "c"};
    OK(file_make_dirs(scene, &err));
    put("scene/room.obj", MESH);
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
    put("scene/transforms.json", "{\"fl_x\":8,\"frames\":[" FRAME("a") "," FRAME("b") "," FRAME("c") "]}");
}

static enum status reconstruct(void) {
    cJSON *json = cJSON_Parse(SETTINGS);
    struct progress progress = {.fd = -1};
    struct order order = {.dir = dir,
                          .kind = "reconstruct",
                          .thread_count = 1,
                          .scene = scene,
                          .scene_id = "x",
                          .name = "",
                          .reduced = "",
                          .settings = json};
    err = (struct error){0};
    enum status status = task_reconstruct(&order, &progress, &err);
    cJSON_Delete(json);
    return status;
}

/* One of each way to write. */
static void damage_each(void) {
    static const struct {
        const char *end;
        long at;
    } outputs[] = {
        {"/base_color.exr", 600},
        {"/preview/base_color.png", 70},
        {"/out/scene.ply", 380},
        {"/out/report.json", 600},
    };
    OK(reconstruct());
    for (size_t i = 0; i < sizeof outputs / sizeof *outputs; i++) {
        damaged = outputs[i].end;
        damaged_at = outputs[i].at;
        damaged_count = 0;
        enum status status = reconstruct();
        damaged = NULL;
        CHECK_THAT(damaged_count > 0, "%s has no byte %ld", outputs[i].end, damaged_at);
        CHECK_THAT(status == STATUS_CORRUPT && strstr(err.message, outputs[i].end) && strstr(err.message, "read back"),
                   "%s: %s: %s", outputs[i].end, status_name(status), err.message);
    }
}

/* --- by our own readers ------------------------------------------------------------------------------ */

static void reads(const char *name, const char *text, const struct mesh *mesh, const char *complaint) {
    char *path = file_join(dir, name);
    put(name, text);
    err = (struct error){0};
    enum status status = read_back(path, name, mesh, &err);
    if (complaint)
        CHECK_THAT(status == STATUS_CORRUPT && strstr(err.message, complaint), "%s: %s", status_name(status),
                   err.message);
    else
        OK(status);
    mem_free(path);
}

static void read_meshes(void) {
    vec3 position[4] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}};
    uint32_t index[2][3] = {{0, 1, 2}, {1, 3, 2}};
    struct mesh mesh = {.vertex_count = 4, .position = position, .triangle_count = 2, .index = index};
    reads("a.obj", MESH, &mesh, NULL);
    reads("a.obj", "v 0 0 0\nv 0 0 1\nv 0 1 0\nv 0 1 1\nf 2 4 3\nf 1 2 3\n", &mesh,
          NULL); /* turned, in another order */
    reads("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\n", &mesh, "1 triangles, not 2");
    reads("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1.1 0\nf 1 2 3\nf 2 4 3\n", &mesh, "lie elsewhere");
    reads("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 5 3\n", &mesh, "read back");
    reads("a.ply", "ply\nformat ascii 1.0\nelement vertex 3\n", &mesh, "read back");
    reads("a.glb", "glTF", &mesh, "read back");
    reads("a.json", "{\"a\":1}", &mesh, NULL);
    reads("a.json", "{\"a\":1", &mesh, "read back");
    CHECK(read_back("/nowhere/a.json", "a.json", &mesh, &err) == STATUS_NOT_FOUND);
}

int main(void) {
    snprintf(dir, sizeof dir, "%s/unbake-test-outputs-XXXXXX", check_fast_dir());
    CHECK(mkdtemp(dir) != NULL);
    scene = file_join(dir, "scene");
    put_scene();
    damage_each();
    read_meshes();
    char *remove = mem_printf("rm -rf '%s'", dir);
    CHECK(system(remove) == 0);
    mem_free(remove);
    mem_free(scene);
    return check_result();
}
