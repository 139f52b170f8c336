/* test_outputs_read_back.c -- an attempt of which one output was damaged on its way to the disk fails and says which:
 * no reader is left to find out. One byte of one file after the other changes between the worker and the system. */
#include <dlfcn.h>

#include "common/json.h"
#include "server/worker/read_back.h"
#include "tests/unit/tiny_scene.h"

static const char *damaged;            /* the end of the name of the file of which a byte changes */
static long damaged_at, damaged_count; /* which one; how often it did */

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
    OK(reconstruct("{" TINY_SETTINGS "}", scene, ""));
    for (size_t i = 0; i < sizeof outputs / sizeof *outputs; i++) {
        damaged = outputs[i].end;
        damaged_at = outputs[i].at;
        damaged_count = 0;
        enum status status = reconstruct("{" TINY_SETTINGS "}", scene, "");
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
    reads("a.obj", TINY_MESH, &mesh, NULL);
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
    tiny_scene_make("test-outputs");
    damage_each();
    read_meshes();
    tiny_scene_remove();
    return check_result();
}
