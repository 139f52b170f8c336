/* seen.c -- see seen.h. */
#include "server/evaluate/seen.h"

#include "common/rng.h"
#include "server/evaluate/score.h"

struct job {
    const struct seen *seen;
    const struct camera *camera;
    uint8_t *flags;
};

static bool camera_sees(const struct seen *s, const struct camera *camera, vec3 point, vec3 normal) {
    float x, y, depth;
    if (!camera_project(camera, point, &x, &y, &depth))
        return false;
    vec3 to_camera = vec3_sub(camera_origin(camera), point);
    float distance = vec3_length(to_camera);
    vec3 direction = vec3_scale(to_camera, 1.0f / distance);
    return !accel_occluded(s->accel, accel_offset(point, normal, direction), direction, 0.0f,
                           distance);
}

/* Starts with the camera that saw the last point: the next is near it. */
static bool any_sees(const struct seen *s, vec3 point, vec3 normal, size_t *last) {
    for (size_t i = 0; i < s->train_count; i++) {
        size_t camera = (*last + i) % s->train_count;
        if (camera_sees(s, &s->train[camera], point, normal)) {
            *last = camera;
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

static uint8_t pixel_flags(const struct job *job, uint32_t x, uint32_t y, size_t *last) {
    const struct seen *s = job->seen;
    uint8_t flags = SCORE_PLAIN | SCORE_SEEN;
    vec3 origin = camera_origin(job->camera);
    for (uint32_t i = 0; i < SEEN_SAMPLES; i++) {
        vec2 place = sample_place(x, y, i);
        vec3 direction;
        struct accel_hit hit;
        if (!camera_direction(job->camera, place.x, place.y, &direction) ||
            !accel_intersect(s->accel, origin, direction, 0.0f, INFINITY, &hit) ||
            s->emits[hit.triangle])
            return 0;
        if (flags & SCORE_SEEN) {
            vec3 point = mesh_point(s->mesh, hit.triangle, hit.b1, hit.b2);
            vec3 normal = vec3_normalize(mesh_cross(s->mesh, hit.triangle));
            if (!any_sees(s, point, normal, last))
                flags = SCORE_PLAIN;
        }
    }
    return flags;
}

static void flag_row(void *user, size_t row, int thread) {
    const struct job *job = user;
    uint32_t width = job->camera->width, y = (uint32_t)row;
    size_t last = 0;
    (void)thread;
    for (uint32_t x = 0; x < width; x++)
        job->flags[(size_t)y * width + x] = pixel_flags(job, x, y, &last);
}

void seen_flags(const struct seen *seen, const struct camera *camera, struct parallel *pool,
                uint8_t *flags) {
    struct job job = {seen, camera, flags};
    parallel_for(pool, camera->height, flag_row, &job);
}
