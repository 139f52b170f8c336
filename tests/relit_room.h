/* relit_room.h -- the outputs of a reconstruction that has not happened: rooms
 * of rectangles, for tests of renders. */
#ifndef UNBAKE_TESTS_RELIT_ROOM_H
#define UNBAKE_TESTS_RELIT_ROOM_H

#include "common/vec.h"
#include "tests/relit.h"

#define RELIT_CELL 4 /* texels a side of a rectangle's part of the textures */

/* A segment; its front is where edge1 x edge2 points. */
struct relit_quad {
    vec3 corner, edge1, edge2;
    rgb base_color, emission;
    float roughness, specular;
};

static inline enum status relit_texture(const char *dir, const char *name, const struct relit_quad *quad, size_t count,
                                        rgb (*value)(const struct relit_quad *)) {
    struct image image;
    char *path = file_join(dir, name);
    image_init_rgb(&image, RELIT_CELL, RELIT_CELL * (uint32_t)count);
    for (size_t i = 0; i < count * RELIT_CELL * RELIT_CELL; i++) {
        rgb v = value(&quad[i / (RELIT_CELL * RELIT_CELL)]);
        memcpy(image.pixel + 3 * i, &v, sizeof v);
    }
    enum status status = image_write_exr(path, &image, IMAGE_FLOAT, false, NULL);
    image_release(&image);
    mem_free(path);
    return status;
}

static inline rgb relit_base_color(const struct relit_quad *q) { return q->base_color; }
static inline rgb relit_emission(const struct relit_quad *q) { return q->emission; }
static inline rgb relit_roughness(const struct relit_quad *q) { return rgb_gray(q->roughness); }
static inline rgb relit_specular(const struct relit_quad *q) { return rgb_gray(q->specular); }

/* scene.ply, as export/mesh_ply.c writes it. */
static inline enum status relit_mesh(const char *dir, const struct relit_quad *quad, size_t count) {
    char *path = file_join(dir, "scene.ply");
    struct buf text;
    buf_init(&text, 1 << 20);
    buf_printf(&text,
               "ply\nformat binary_little_endian 1.0\nelement vertex %zu\nproperty "
               "float x\nproperty float y\n"
               "property float z\nproperty float s\nproperty float t\nelement face %zu\n"
               "property list uchar int vertex_indices\nproperty int segment\nproperty "
               "int face\nend_header\n",
               4 * count, 2 * count);
    for (size_t i = 0; i < count; i++)
        for (int k = 0; k < 4; k++) {
            float a = k == 1 || k == 2 ? 1.0f : 0.0f, b = k >= 2 ? 1.0f : 0.0f;
            vec3 p = vec3_mad(vec3_mad(quad[i].corner, a, quad[i].edge1), b, quad[i].edge2);
            float x = 0.5f + a * (RELIT_CELL - 1), y = RELIT_CELL * (float)i + 0.5f + b * (RELIT_CELL - 1);
            const float vertex[5] = {p.x, p.y, p.z, x / RELIT_CELL, 1.0f - y / (RELIT_CELL * (float)count)};
            buf_append(&text, vertex, sizeof vertex);
        }
    for (uint32_t f = 0; f < 2 * count; f++) {
        uint32_t first = f / 2 * 4, face[5] = {first, first + 1 + f % 2, first + 2 + f % 2, f / 2, f};
        buf_append(&text, "\3", 1);
        buf_append(&text, face, sizeof face);
    }
    enum status status = file_replace(path, text.data, text.length, NULL);
    buf_release(&text);
    mem_free(path);
    return status;
}

/* The outputs' folder; the caller's (relit_remove). `views` is the text of
 * views.json. */
static inline char *relit_outputs(const struct relit_quad *quad, size_t count, const char *views) {
    char *dir = mem_strdup("/tmp/unbake-room-XXXXXX"), *path;
    CHECK(mkdtemp(dir) != NULL);
    CHECK(relit_mesh(dir, quad, count) == STATUS_OK);
    CHECK(relit_texture(dir, "base_color.exr", quad, count, relit_base_color) == STATUS_OK);
    CHECK(relit_texture(dir, "emission.exr", quad, count, relit_emission) == STATUS_OK);
    CHECK(relit_texture(dir, "roughness.exr", quad, count, relit_roughness) == STATUS_OK);
    CHECK(relit_texture(dir, "specular.exr", quad, count, relit_specular) == STATUS_OK);
    path = file_join(dir, "views.json");
    CHECK(file_replace(path, views, strlen(views), NULL) == STATUS_OK);
    mem_free(path);
    return dir;
}

/* Six walls of a cube from -1 to 1, which face inwards: floor, ceiling, then
 * -x, +x, -z, +z. */
static inline void relit_cube(struct relit_quad quad[6], rgb base_color, rgb emission) {
    static const vec3 shape[6][3] = {{{-1, -1, -1}, {0, 0, 2}, {2, 0, 0}}, {{-1, 1, -1}, {2, 0, 0}, {0, 0, 2}},
                                     {{-1, -1, -1}, {0, 2, 0}, {0, 0, 2}}, {{1, -1, -1}, {0, 0, 2}, {0, 2, 0}},
                                     {{-1, -1, -1}, {2, 0, 0}, {0, 2, 0}}, {{-1, -1, 1}, {0, 2, 0}, {2, 0, 0}}};
    for (int i = 0; i < 6; i++)
        quad[i] = (struct relit_quad){shape[i][0], shape[i][1], shape[i][2], base_color, emission, 0.5f, 0.0f};
}

static inline double relit_mean(const struct image *image) {
    double sum = 0.0;
    size_t count = (size_t)image->width * image->height * 3;
    for (size_t i = 0; i < count; i++)
        sum += (double)image->pixel[i] / (double)count;
    return sum;
}

#endif
