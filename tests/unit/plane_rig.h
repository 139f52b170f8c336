/* plane_rig.h -- a plane of 10 x 10 m in z = 0 that faces +z, of one segment and one chart of PLANE_SIDE x PLANE_SIDE
 * texels, and any number of photographs of it: for tests in closed form of what is made of photographs.
 *
 * Beside the plane there is nothing, but a roof above one half of it where the test wants one, and no light but what
 * the test sets. */
#ifndef UNBAKE_TESTS_UNIT_PLANE_RIG_H
#define UNBAKE_TESTS_UNIT_PLANE_RIG_H

#include "common/image.h"
#include "common/mem.h"
#include "server/gather/probes.h"
#include "server/material/divide.h"
#include "server/reconstruct/inputs.h"
#include "server/state/evidence.h"
#include "server/state/reconstruction.h"
#include "tests/check.h"

#define PLANE_SIDE 32
#define PLANE_TEXELS (PLANE_SIDE * PLANE_SIDE)
#define PLANE_METRES 10.0f
#define PLANE_PIXELS 16                                             /* of a photograph, along each side */
#define PLANE_MIDDLE (PLANE_SIDE / 2 * PLANE_SIDE + PLANE_SIDE / 2) /* the texel beyond the plane's middle */

struct plane_rig {
    struct scene scene;
    struct reconstruction r;
    struct views views; /* of plane_rig_look on */
    struct parallel *pool;
    size_t capacity; /* photographs */
};

/* The first `triangles` of the plane's two and of those of a roof 3 m above its half of negative x, which faces down
 * and has no texels. */
static inline void plane_rig_init_triangles(struct plane_rig *rig, size_t photographs, int threads, size_t triangles) {
    static vec3 position[8] = {{-5, -5, 0}, {5, -5, 0}, {5, 5, 0}, {-5, 5, 0},
                               {-5, -5, 3}, {0, -5, 3}, {0, 5, 3}, {-5, 5, 3}};
    static uint32_t index[4][3] = {{0, 1, 2}, {0, 2, 3}, {4, 6, 5}, {4, 7, 6}}, of_triangle[4], chart_of_triangle[4];
    static vec2 corner[4][3];
    static bool is_emitter[1];
    static struct emitter_evidence evidence[1];
    *rig = (struct plane_rig){.pool = parallel_new(threads), .capacity = photographs};
    for (size_t t = 0; t < 2; t++)
        for (size_t k = 0; k < 3; k++)
            corner[t][k] = (vec2){(position[index[t][k]].x / PLANE_METRES + 0.5f) * PLANE_SIDE,
                                  (position[index[t][k]].y / PLANE_METRES + 0.5f) * PLANE_SIDE};
    rig->scene.mesh =
        (struct mesh){.vertex_count = 2 * triangles, .position = position, .triangle_count = triangles, .index = index};
    rig->scene.photograph = mem_calloc(photographs, sizeof *rig->scene.photograph);
    struct reconstruction *r = &rig->r;
    *r = (struct reconstruction){
        .scene = &rig->scene, .pool = rig->pool, .is_emitter = is_emitter, .evidence = evidence};
    r->segments = (struct segments){.count = 1, .of_triangle = of_triangle};
    r->atlas = (struct atlas){.width = PLANE_SIDE,
                              .height = PLANE_SIDE,
                              .texels_per_metre = PLANE_SIDE / PLANE_METRES,
                              .chart_count = 1,
                              .chart_of_triangle = chart_of_triangle,
                              .corner = corner};
    inverse_uv_make(&r->inverse, &r->atlas, 2, rig->pool);
    materials_init(&r->materials, &r->inverse, 1, rgb_gray(0.5f), 0.5f, 0.0f);
    struct error err;
    CHECK(world_init(&r->world, &rig->scene.mesh, &r->segments, &r->atlas, &r->materials, NULL, rig->pool, &err) ==
          STATUS_OK);
}

static inline void plane_rig_init(struct plane_rig *rig, size_t photographs, int threads) {
    plane_rig_init_triangles(rig, photographs, threads, 2);
}

static inline void plane_rig_init_roofed(struct plane_rig *rig, size_t photographs, int threads) {
    plane_rig_init_triangles(rig, photographs, threads, 4);
}

/* Adds a photograph from a place above that looks at another; its middle pixel covers `pixel_m` at that distance, and
 * each shows paint(user, its place on the plane). */
static inline struct photograph *plane_rig_add(struct plane_rig *rig, vec3 from, vec3 to, float pixel_m,
                                               rgb paint(void *user, vec3 place), void *user) {
    CHECK(rig->scene.photograph_count < rig->capacity);
    struct photograph *photo = &rig->scene.photograph[rig->scene.photograph_count++];
    float focal = vec3_length(vec3_sub(to, from)) / pixel_m;
    vec3 z = vec3_normalize(vec3_sub(to, from)), x = vec3_normalize(vec3_cross(z, (vec3){0.01f, 1.0f, 0.02f}));
    vec3 y = vec3_cross(z, x);
    struct rigid world_from_camera = {{{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}}, from};
    *photo = (struct photograph){
        .is_hdr = true, .exposure_known = true, .exposure = 1.0f, .gain = {1, 1, 1}, .clip = INFINITY};
    photo->camera = (struct camera){.width = PLANE_PIXELS,
                                    .height = PLANE_PIXELS,
                                    .fx = focal,
                                    .fy = focal,
                                    .cx = PLANE_PIXELS / 2.0f,
                                    .cy = PLANE_PIXELS / 2.0f,
                                    .world_from_camera = world_from_camera,
                                    .camera_from_world = rigid_inverse(&world_from_camera)};
    photo->pixel = mem_array(PLANE_PIXELS * PLANE_PIXELS, sizeof *photo->pixel);
    for (size_t i = 0; i < PLANE_PIXELS * PLANE_PIXELS; i++) {
        vec3 d;
        CHECK(camera_direction(&photo->camera, (float)(i % PLANE_PIXELS) + 0.5f, (float)(i / PLANE_PIXELS) + 0.5f, &d));
        rgb shown = paint(user, vec3_mad(from, -from.z / d.z, d));
        for (size_t c = 0; c < 3; c++)
            photo->pixel[i][c] = image_half_from_float((&shown.r)[c]);
    }
    return photo;
}

/* After the last photograph. They have the same noise, a share of what they show. */
static inline void plane_rig_look(struct plane_rig *rig, float noise) {
    struct reconstruction *r = &rig->r;
    views_init(&rig->views, &rig->scene, &r->segments, r->world.accel, rig->pool);
    noise_measure(&r->noise, &rig->views, rig->pool);
    for (size_t k = 0; k < NOISE_OCTAVES; k++)
        r->noise.share[k] = noise;
    fuse(&r->fused, &rig->views, &r->noise, &r->atlas, &r->inverse, rig->pool);
}

static inline void plane_rig_release(struct plane_rig *rig) {
    struct reconstruction *r = &rig->r;
    fused_release(&r->fused);
    noise_release(&r->noise);
    views_release(&rig->views);
    world_release(&r->world);
    materials_release(&r->materials);
    inverse_uv_release(&r->inverse);
    for (size_t i = 0; i < rig->scene.photograph_count; i++)
        mem_free(rig->scene.photograph[i].pixel);
    mem_free(rig->scene.photograph);
    parallel_free(rig->pool);
}

/* A colour for all places: that which `user` points at. */
static inline rgb plane_paint_one(void *user, vec3 place) {
    (void)place;
    return *(const rgb *)user;
}

/* Base colour at the middle texel, without highlights, as `probes` have the light; *divide stays for more, its
 * `measured` is to be freed. *typical is to outlive it. */
static inline const struct measurement *plane_rig_divide(struct plane_rig *rig, const struct probes *probes,
                                                         float *typical, struct divide *divide) {
    static const uint32_t texel = PLANE_MIDDLE;
    *typical = 0.5f;
    static const struct sun_shadows no_shadows;
    *divide = inputs_of_divide(&rig->r, &rig->views, probes, NULL, &no_shadows);
    divide->stride = 1;
    divide->typical = typical;
    divide->highlight_samples = 4;
    divide->measured = mem_calloc(PLANE_TEXELS, sizeof *divide->measured);
    divide_texels(divide, &texel, 1);
    return &divide->measured[texel];
}

#endif
