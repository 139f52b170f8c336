/* small_room.h -- a closed room of six plain walls and a lamp, photographed by our own path tracer:
 * a scene for tests that need photographs and no data. */
#ifndef UNBAKE_TESTS_RENDER_SMALL_ROOM_H
#define UNBAKE_TESTS_RENDER_SMALL_ROOM_H

#include "common/mem.h"
#include "server/render/film.h"
#include "server/scene/inverse_uv.h"
#include "server/scene/scene.h"
#include "server/scene/surface.h"
#include "tests/check.h"

#define OBJECTS 7 /* six walls and a lamp */
#define FLOOR 0
#define LAMP 6
#define FRAMES 20
#define WIDTH 48
#define HEIGHT 36

/* A test may change these before walls are photographed. */
static rgb wall_color[OBJECTS] = {{0.6f, 0.5f, 0.4f}, {0.8f, 0.8f, 0.8f}, {0.7f, 0.2f, 0.2f}, {0.2f, 0.6f, 0.3f},
                                  {0.7f, 0.7f, 0.6f}, {0.5f, 0.6f, 0.8f}, {0.4f, 0.4f, 0.4f}};
/* A test may make walls glossy before they are photographed. */
static float wall_roughness[OBJECTS] = {1.0f, 1.0f, 1.0f, 1.0f, 1.0f, 1.0f, 1.0f};
static float wall_specular[OBJECTS];
/* Of each pixel. A test for whose outcome noise matters may take more: a set takes .024 s for each. */
static uint32_t photograph_samples = 32;
static const rgb lamp_radiance = {9.0f, 8.0f, 6.0f};
/* A test may have another object shine as the lamp does. */
static size_t other_lamp = LAMP;
/* A test may have the lamp show a picture: the radiance at a place of it over lamp_radiance. */
static rgb (*lamp_picture)(vec3 place);

static inline void add_quad(struct mesh *m, int64_t object, vec3 corner, vec3 u, vec3 v) {
    uint32_t first = (uint32_t)m->vertex_count;
    m->position[m->vertex_count++] = corner;
    m->position[m->vertex_count++] = vec3_add(corner, u);
    m->position[m->vertex_count++] = vec3_add(vec3_add(corner, u), v);
    m->position[m->vertex_count++] = vec3_add(corner, v);
    for (uint32_t t = 0; t < 2; t++) {
        size_t i = m->triangle_count++;
        m->index[i][0] = first;
        m->index[i][1] = first + 1 + t;
        m->index[i][2] = first + 2 + t;
        m->face[i] = (uint32_t)i;
        m->object_id[i] = object;
    }
    m->face_count = m->triangle_count;
}

/* Floor, ceiling and the two walls across x of a room of 4 x 3 x 3 m, normals inward, y up; memory for so many
 * quads. */
static inline void start_room(struct mesh *m, size_t quads) {
    *m = (struct mesh){0};
    m->position = mem_array(4 * quads, sizeof *m->position);
    m->index = mem_array(2 * quads, sizeof *m->index);
    m->face = mem_array(2 * quads, sizeof *m->face);
    m->object_id = mem_array(2 * quads, sizeof *m->object_id);
    vec3 x = {4, 0, 0}, y = {0, 3, 0}, z = {0, 0, 3};
    add_quad(m, FLOOR, (vec3){0, 0, 0}, z, x);
    add_quad(m, 1, (vec3){0, 3, 0}, x, z);
    add_quad(m, 2, (vec3){0, 0, 0}, y, z);
    add_quad(m, 3, (vec3){4, 0, 0}, z, y);
}

/* A lamp of 1 m^2 under the ceiling. */
static inline void add_lamp(struct mesh *m) {
    add_quad(m, LAMP, (vec3){1.5f, 2.9f, 1.0f}, (vec3){1, 0, 0}, (vec3){0, 0, 1});
}

/* The whole room, closed, with its lamp. */
static inline void make_mesh(struct mesh *m) {
    start_room(m, OBJECTS);
    add_quad(m, 4, (vec3){0, 0, 0}, (vec3){4, 0, 0}, (vec3){0, 3, 0});
    add_quad(m, 5, (vec3){0, 0, 3}, (vec3){0, 3, 0}, (vec3){4, 0, 0});
    add_lamp(m);
}

/* The same with a window of 2 x 1.5 m in the wall at z = 0. */
static inline void make_mesh_with_window(struct mesh *m) {
    vec3 x = {4, 0, 0};
    start_room(m, OBJECTS + 3);
    add_quad(m, 5, (vec3){0, 0, 3}, (vec3){0, 3, 0}, x);
    add_quad(m, 4, (vec3){0, 0, 0}, x, (vec3){0, 1.25f, 0});
    add_quad(m, 4, (vec3){0, 2.75f, 0}, x, (vec3){0, 0.25f, 0});
    add_quad(m, 4, (vec3){0, 1.25f, 0}, (vec3){1, 0, 0}, (vec3){0, 1.5f, 0});
    add_quad(m, 4, (vec3){3, 1.25f, 0}, (vec3){1, 0, 0}, (vec3){0, 1.5f, 0});
    add_lamp(m);
}

/* Each channel within a share of what it should be. */
#define CHECK_RGB(found, wanted, share)                                                                                \
    do {                                                                                                               \
        CHECK_NEAR((found).r, (wanted).r, (share) * (wanted).r);                                                       \
        CHECK_NEAR((found).g, (wanted).g, (share) * (wanted).g);                                                       \
        CHECK_NEAR((found).b, (wanted).b, (share) * (wanted).b);                                                       \
    } while (0)

/* A camera at `from` that looks at `to`. */
static inline struct camera look(vec3 from, vec3 to) {
    struct camera c = {.width = WIDTH, .height = HEIGHT, .fx = 30, .fy = 30, .cx = WIDTH / 2.0f, .cy = HEIGHT / 2.0f};
    vec3 z = vec3_normalize(vec3_sub(to, from));
    vec3 x = vec3_normalize(vec3_cross(z, (vec3){0.01f, 1.0f, 0.02f}));
    vec3 y = vec3_cross(z, x);
    struct rigid w = {{{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}}, from};
    c.world_from_camera = w;
    c.camera_from_world = rigid_inverse(&w);
    return c;
}

static inline vec3 spread(int i, float margin) {
    float a = fmodf((float)i * 0.618f, 1.0f), b = fmodf((float)i * 0.755f, 1.0f);
    float c = fmodf((float)i * 0.570f, 1.0f);
    return (vec3){margin + a * (4 - 2 * margin), margin + b * (2.6f - 2 * margin), margin + c * (3 - 2 * margin)};
}

static inline vec3 look_anywhere(int frame) { return spread(frame * 7 + 3, 0.0f); }

/* A test may place the cameras. */
static vec3 (*camera_place)(int frame);

/* What a mesh needs beside itself to be rendered. */
struct model {
    struct segments segments;
    struct atlas atlas;
    struct inverse_uv inverse;
    struct materials materials;
    struct world world;
};

/* Matt and of one grey, with nothing that emits; model_light is to follow. */
static inline void model_init(struct model *m, const struct mesh *mesh, uint32_t texture_size, float gray,
                              struct parallel *pool) {
    struct error err = {0};
    segments_from_object_id(&m->segments, mesh);
    CHECK(atlas_make(&m->atlas, mesh, &m->segments, texture_size, 0.0f, ATLAS_PADDING, &err) == STATUS_OK);
    inverse_uv_make(&m->inverse, &m->atlas, mesh->triangle_count, pool);
    materials_init(&m->materials, &m->inverse, OBJECTS, rgb_gray(gray), 1.0f, 0.0f);
}

static inline void model_light(struct model *m, const struct mesh *mesh, rgb lamp, const struct image *environment,
                               struct parallel *pool) {
    struct error err = {0};
    m->materials.emission[LAMP] = m->materials.emission[other_lamp] = lamp;
    CHECK(world_init(&m->world, mesh, &m->segments, &m->atlas, &m->materials, environment, pool, &err) == STATUS_OK);
}

static inline void model_release(struct model *m) {
    world_release(&m->world);
    materials_release(&m->materials);
    inverse_uv_release(&m->inverse);
    atlas_release(&m->atlas);
    segments_release(&m->segments);
}

/* Has the lamp show its picture. */
static inline void model_show_picture(struct model *m, const struct mesh *mesh, rgb picture(vec3 place)) {
    materials_start_emission_pattern(&m->materials);
    for (size_t i = 0; i < m->inverse.valid_count; i++) {
        uint32_t texel = m->inverse.valid[i];
        struct surface_point at;
        if (m->segments.of_triangle[m->inverse.triangle[texel]] == LAMP &&
            surface_at_texel(mesh, &m->atlas, &m->inverse, texel, &at))
            materials_set_emission_pattern(&m->materials, texel, picture(at.position), rgb_gray(1.0f));
    }
}

/* Photographs of scene->mesh in its true colours by FRAMES cameras, which look at target(frame); every
 * fifth of them is held out. environment may be NULL. */
static inline void photograph_mesh(struct scene *scene, rgb lamp, const struct image *environment,
                                   vec3 target(int frame), struct parallel *pool) {
    struct model truth;
    model_init(&truth, &scene->mesh, 128, 0.5f, pool);
    for (size_t i = 0; i < truth.inverse.valid_count; i++) {
        uint32_t texel = truth.inverse.valid[i];
        rgb color = wall_color[truth.segments.of_triangle[truth.inverse.triangle[texel]]];
        memcpy(truth.materials.base_color.texel[texel], &color, sizeof color);
    }
    memcpy(truth.materials.roughness, wall_roughness, sizeof wall_roughness);
    memcpy(truth.materials.specular, wall_specular, sizeof wall_specular);
    if (lamp_picture)
        model_show_picture(&truth, &scene->mesh, lamp_picture);
    model_light(&truth, &scene->mesh, lamp, environment, pool);
    struct path_settings path = {.max_depth = 8, .roulette_depth = 5, .seed = 99};
    scene->photograph = mem_calloc(FRAMES, sizeof *scene->photograph);
    scene->photograph_count = FRAMES;
    for (int f = 0; f < FRAMES; f++) {
        struct photograph *photo = &scene->photograph[f];
        *photo = (struct photograph){.is_hdr = true,
                                     .exposure_known = true,
                                     .exposure = 1.0f,
                                     .gain = {1, 1, 1},
                                     .clip = INFINITY,
                                     .is_test = f % 5 == 4};
        photo->name = mem_printf("frame %d", f);
        photo->camera = look(camera_place ? camera_place(f) : spread(f, 0.4f), target(f));
        struct image image;
        film_render(&truth.world, &photo->camera, photograph_samples, &path, (uint32_t)f, pool, &image);
        photo->pixel = mem_array(WIDTH * HEIGHT, sizeof *photo->pixel);
        for (size_t i = 0; i < WIDTH * HEIGHT; i++) {
            for (size_t c = 0; c < 3; c++)
                photo->pixel[i][c] = image_half_from_float(image.pixel[image.channel_count * i + c]);
        }
        image_release(&image);
    }
    model_release(&truth);
}

/* As a photograph shows it that saturates at `clip`, exact as a half. */
static inline void saturate_photograph(struct photograph *photo, float clip) {
    photo->is_hdr = false;
    photo->clip = clip;
    for (size_t i = 0; i < WIDTH * HEIGHT; i++) {
        for (size_t c = 0; c < 3; c++) {
            float value = image_float_from_half(photo->pixel[i][c]);
            photo->pixel[i][c] = image_half_from_float(fminf(value, clip));
        }
    }
}

static inline void make_scene(struct scene *scene, struct parallel *pool) {
    *scene = (struct scene){0};
    make_mesh(&scene->mesh);
    photograph_mesh(scene, lamp_radiance, NULL, look_anywhere, pool);
}

#endif
