/* seen.c -- see seen.h. */
#include "server/evaluate/seen.h"

#include "common/rng.h"
#include "server/evaluate/score.h"

struct job {
    const struct seen *seen;
    const struct camera *camera;
    uint8_t *flags;
};

static bool view_sees(const struct views *v, uint32_t train, vec3 point, vec3 normal) {
    const struct camera *camera = &v->scene->photograph[v->train[train]].camera;
    struct view view = {.train = train};
    float depth;
    if (!camera_project(camera, point, &view.x, &view.y, &depth) || !views_clean(v, &view))
        return false;
    vec3 to_camera = vec3_sub(camera_origin(camera), point);
    float distance = vec3_length(to_camera);
    vec3 direction = vec3_scale(to_camera, 1.0f / distance);
    return !accel_occluded(v->accel, accel_offset(point, normal, direction), direction, 0.0f,
                           distance);
}

/* Starts with the view that saw the last point: the next is near it. */
static bool any_sees(const struct views *v, vec3 point, vec3 normal, uint32_t *last) {
    for (uint32_t i = 0; i < v->train_count; i++) {
        uint32_t train = (*last + i) % (uint32_t)v->train_count;
        if (view_sees(v, train, point, normal)) {
            *last = train;
            return true;
        }
    }
    return false;
}

/* A 4 x 4 grid of jittered places. */
static vec2 sample_place(uint32_t x, uint32_t y, uint32_t sample) {
    uint64_t bits = rng_key(x, y, sample);
    return vec2_make((float)x + ((float)(sample % 4) + rng_to_float((uint32_t)bits)) / 4.0f,
                     (float)y + ((float)(sample / 4) + rng_to_float((uint32_t)(bits >> 32))) / 4.0f);
}

static uint8_t pixel_flags(const struct job *job, uint32_t x, uint32_t y, uint32_t *last) {
    const struct views *v = job->seen->views;
    const struct mesh *mesh = &v->scene->mesh;
    uint8_t flags = SCORE_PLAIN | SCORE_SEEN;
    vec3 origin = camera_origin(job->camera);
    for (uint32_t i = 0; i < SEEN_SAMPLES; i++) {
        vec2 place = sample_place(x, y, i);
        vec3 direction;
        struct accel_hit hit;
        if (!camera_direction(job->camera, place.x, place.y, &direction) ||
            !accel_intersect(v->accel, origin, direction, 0.0f, INFINITY, &hit) ||
            job->seen->emits[hit.triangle])
            return 0;
        if (flags & SCORE_SEEN) {
            vec3 point = mesh_point(mesh, hit.triangle, hit.b1, hit.b2);
            vec3 normal = vec3_normalize(mesh_cross(mesh, hit.triangle));
            if (!any_sees(v, point, normal, last))
                flags = SCORE_PLAIN;
        }
    }
    return flags;
}

static void flag_row(void *user, size_t row, int thread) {
    const struct job *job = user;
    uint32_t width = job->camera->width, y = (uint32_t)row;
    uint32_t last = 0;
    (void)thread;
    for (uint32_t x = 0; x < width; x++)
        job->flags[(size_t)y * width + x] = pixel_flags(job, x, y, &last);
}

void seen_flags(const struct seen *seen, const struct camera *camera, struct parallel *pool,
                uint8_t *flags) {
    struct job job = {seen, camera, flags};
    parallel_for(pool, camera->height, flag_row, &job);
}
