/* fit_rig.h -- a small room with painted walls, photographed by rays, for the tests of server/check. */
#ifndef UNBAKE_TESTS_FIT_RIG_H
#define UNBAKE_TESTS_FIT_RIG_H

#include "common/rng.h"
#include "server/check/fit.h"
#include "server/scene/rgb_half.h"
#include "tests/unit/room.h"

#define FIT_PHOTOGRAPHS 16
#define FIT_WIDTH 96
#define FIT_HEIGHT 72
#define FIT_FOCAL 60.0f

struct fit_rig {
    struct parallel *pool;
    struct scene scene;
};

/* Smooth noise in [0, 1] of a cell of 4 (waves of about half a metre), the same at the same place from everywhere. */
static inline float fit_paint(vec3 p, float cell) {
    const float c[3] = {p.x / cell + 100.0f, p.y / cell + 100.0f, p.z / cell + 100.0f};
    float sum = 0.0f;
    for (int corner = 0; corner < 8; corner++) {
        uint32_t key = 0;
        float weight = 1.0f;
        for (int i = 0; i < 3; i++) {
            int at = (int)c[i] + (corner >> i & 1);
            float t = c[i] - (float)(int)c[i];
            weight *= corner >> i & 1 ? t : 1.0f - t;
            key = rng_mix32(key ^ (uint32_t)at);
        }
        sum += weight * rng_to_float(key);
    }
    return sum;
}

static inline void fit_add_box(struct mesh *m, vec3 low, vec3 high) {
    static const uint32_t faces[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                         {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
    uint32_t base = (uint32_t)m->vertex_count;
    for (int i = 0; i < 8; i++)
        m->position[m->vertex_count++] =
            vec3_make(i & 1 ? high.x : low.x, i & 2 ? high.y : low.y, i & 4 ? high.z : low.z);
    for (int f = 0; f < 6; f++)
        for (uint32_t half = 0; half < 2; half++) {
            uint32_t *t = m->index[m->triangle_count++];
            t[0] = base + faces[f][0];
            t[1] = base + faces[f][1 + half];
            t[2] = base + faces[f][2 + half];
        }
}

/* 5 x 3.2 x 4 m with three boxes in it; z is up; no axis is a symmetry of it. */
static inline struct mesh fit_mesh(void) {
    struct mesh m = room_new(32, 48);
    m.vertex_count = m.triangle_count = 0;
    fit_add_box(&m, vec3_make(-2.0f, -1.0f, 0.0f), vec3_make(3.0f, 2.2f, 4.0f));
    fit_add_box(&m, vec3_make(-1.5f, -0.8f, 0.0f), vec3_make(-0.9f, 0.4f, 1.3f));
    fit_add_box(&m, vec3_make(1.7f, 0.9f, 0.0f), vec3_make(2.6f, 1.9f, 0.8f));
    fit_add_box(&m, vec3_make(1.0f, -1.0f, 1.8f), vec3_make(2.0f, -0.7f, 2.5f));
    return m;
}

/* Turns the room's own triangles, the first 12, so that their front is inside; those of the boxes are outside. */
static inline void fit_turn_inside(struct mesh *m) {
    for (size_t t = 0; t < 12; t++) {
        uint32_t second = m->index[t][1];
        m->index[t][1] = m->index[t][2];
        m->index[t][2] = second;
    }
}

/* A camera at `origin` that looks along `forward`; z is up. */
static inline void fit_point_camera(struct camera *camera, vec3 origin, vec3 forward) {
    vec3 z = vec3_normalize(forward), x = vec3_normalize(vec3_cross(z, vec3_make(0.0f, 0.0f, 1.0f)));
    vec3 y = vec3_cross(z, x);
    const float rotation[3][3] = {{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}};
    memcpy(camera->world_from_camera.rotation, rotation, sizeof rotation);
    camera->world_from_camera.translation = origin;
    camera->camera_from_world = rigid_inverse(&camera->world_from_camera);
}

static inline float fit_random(uint32_t a, uint32_t b) { return rng_to_float(rng_mix32(rng_mix32(a + 1) ^ b)); }

/* One with this contrast of the paint (0: plain walls), a gain of its own, and noise of this width. */
static inline void fit_photograph(struct photograph *photo, const struct accel *accel, uint32_t number, float contrast,
                                  float noise) {
    struct camera *c = &photo->camera;
    *c = (struct camera){.width = FIT_WIDTH, .height = FIT_HEIGHT, .fx = FIT_FOCAL, .fy = FIT_FOCAL};
    c->cx = 0.5f * FIT_WIDTH;
    c->cy = 0.5f * FIT_HEIGHT;
    float around = 2.4f * (float)number, u = fit_random(number, 1), v = fit_random(number, 2),
          w = fit_random(number, 3);
    fit_point_camera(c, vec3_make(-0.5f + 2.0f * u, 0.5f + 0.8f * v, 1.4f + 0.9f * w),
                     vec3_make(cosf(around), sinf(around), 0.5f * fit_random(number, 4) - 0.3f));
    photo->pixel = mem_array((size_t)FIT_WIDTH * FIT_HEIGHT, sizeof *photo->pixel);
    photo->name = mem_strdup("photograph");
    photo->exposure = 1.0f;
    photo->gain = rgb_gray(1.0f);
    photo->clip = 1.0f;
    float gain = expf(1.5f * fit_random(number, 5) - 1.5f);
    for (uint32_t i = 0; i < FIT_WIDTH * FIT_HEIGHT; i++) {
        struct accel_hit hit;
        vec3 direction;
        float x = (float)(i % FIT_WIDTH) + 0.5f, y = (float)(i / FIT_WIDTH) + 0.5f, value = 0.5f;
        if (camera_direction(c, x, y, &direction) &&
            accel_intersect(accel, camera_origin(c), direction, 0.0f, INFINITY, &hit))
            value += contrast * (fit_paint(vec3_mad(camera_origin(c), hit.distance_m, direction), 0.25f) - 0.5f);
        value *= gain * (1.0f + noise * (fit_random(number, 100 + i) - 0.5f));
        rgb_to_half(photo->pixel[i], rgb_gray(value));
    }
}

static inline void fit_rig_init_noisy(struct fit_rig *rig, float contrast, float noise) {
    struct accel *accel;
    *rig = (struct fit_rig){.pool = parallel_new(2)};
    rig->scene.mesh = fit_mesh();
    rig->scene.pose_axes = AXES_OPENGL;
    rig->scene.photograph_count = FIT_PHOTOGRAPHS;
    rig->scene.photograph = mem_calloc(FIT_PHOTOGRAPHS, sizeof *rig->scene.photograph);
    CHECK(accel_new(&accel, &rig->scene.mesh, rig->pool, NULL) == STATUS_OK);
    for (uint32_t i = 0; i < FIT_PHOTOGRAPHS; i++)
        fit_photograph(&rig->scene.photograph[i], accel, i, contrast, noise);
    accel_free(accel);
}

static inline void fit_rig_init(struct fit_rig *rig, float contrast) { fit_rig_init_noisy(rig, contrast, 0.02f); }

static inline void fit_rig_release(struct fit_rig *rig) {
    scene_release(&rig->scene);
    parallel_free(rig->pool);
}

/* Of the scene as it is now. */
static inline void fit_rig_judge(const struct fit_rig *rig, struct fit_result *fit) {
    struct accel *accel;
    CHECK(accel_new(&accel, &rig->scene.mesh, rig->pool, NULL) == STATUS_OK);
    fit_judge(fit, &rig->scene, accel, rig->pool);
    accel_free(accel);
}

#endif
