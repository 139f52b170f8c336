/* seen.c -- see seen.h. */
#include "server/evaluate/seen.h"

#include <math.h>

#include "common/mem.h"
#include "common/rng.h"
#include "server/evaluate/score.h"

/* First hit of the ray through a pixel's corner. */
struct seen_corner {
    vec3 point, normal;
    float distance_m;
    int64_t object; /* NOTHING: a miss */
};
#define NOTHING INT64_MIN /* in place of an object */

/* Distance of one corner's point from the plane of another beyond which there is a depth discontinuity: in pixel
 * sizes at that distance, plus a share of the distance for rounding. */
#define EDGE_PIXELS 3.0f
#define EDGE_SHARE 0.002f

struct seen_edge_job {
    const struct seen *seen;
    size_t train;
};

static struct seen_corner trace_corner(const struct seen *s, const struct camera *camera, uint32_t x, uint32_t y) {
    struct seen_corner corner = {.object = NOTHING};
    vec3 origin = camera_origin(camera), direction;
    struct accel_hit hit;
    if (!camera_direction(camera, (float)x, (float)y, &direction) ||
        !accel_intersect(s->accel, origin, direction, 0.0f, INFINITY, &hit))
        return corner;
    corner.point = vec3_mad(origin, hit.distance_m, direction);
    corner.normal = vec3_normalize(mesh_cross(&s->scene->mesh, hit.triangle));
    corner.distance_m = hit.distance_m;
    corner.object = s->scene->mesh.object_id[hit.triangle];
    return corner;
}

static bool edge_between(const struct seen_corner *a, const struct seen_corner *b, float focal) {
    if (a->object != b->object || a->object == NOTHING)
        return a->object != b->object;
    vec3 between = vec3_sub(b->point, a->point);
    float slack = a->distance_m * (EDGE_PIXELS / focal + EDGE_SHARE);
    return fabsf(vec3_dot(between, a->normal)) > slack && fabsf(vec3_dot(between, b->normal)) > slack;
}

static void mark_row(void *user, size_t row, int thread) {
    const struct seen_edge_job *job = user;
    const struct seen *s = job->seen;
    const struct camera *camera = &s->scene->photograph[s->train[job->train]].camera;
    uint8_t *out = s->straddles[job->train] + row * camera->width;
    uint32_t y = (uint32_t)row;
    struct seen_corner left_top = trace_corner(s, camera, 0, y), left_low = trace_corner(s, camera, 0, y + 1);
    (void)thread;
    for (uint32_t x = 0; x < camera->width; x++) {
        struct seen_corner top = trace_corner(s, camera, x + 1, y), low = trace_corner(s, camera, x + 1, y + 1);
        out[x] = edge_between(&left_top, &top, camera->fx) || edge_between(&left_top, &left_low, camera->fx) ||
                 edge_between(&left_top, &low, camera->fx) || edge_between(&top, &left_low, camera->fx);
        left_top = top;
        left_low = low;
    }
}

void seen_init(struct seen *s, const struct scene *scene, const struct accel *accel, const bool *emits,
               struct parallel *pool) {
    *s = (struct seen){.scene = scene, .accel = accel, .emits = emits};
    s->train = mem_array(scene->photograph_count, sizeof *s->train);
    s->straddles = mem_array(scene->photograph_count, sizeof *s->straddles);
    for (size_t i = 0; i < scene->photograph_count; i++) {
        const struct camera *camera = &scene->photograph[i].camera;
        if (scene->photograph[i].is_test)
            continue;
        struct seen_edge_job job = {s, s->train_count++};
        s->train[job.train] = (uint32_t)i;
        s->straddles[job.train] = mem_array((size_t)camera->height * camera->width, 1);
        parallel_for(pool, camera->height, mark_row, &job);
    }
}

void seen_release(struct seen *s) {
    for (size_t t = 0; t < s->train_count; t++)
        mem_free(s->straddles[t]);
    mem_free(s->straddles);
    mem_free(s->train);
    *s = (struct seen){0};
}

struct flag_job {
    const struct seen *seen;
    const struct camera *camera;
    uint8_t *flags;
};

/* Whether one of the four pixels of a lookup lies on an edge. */
static bool on_edge(const struct seen *s, size_t train, float x, float y) {
    const struct camera *camera = &s->scene->photograph[s->train[train]].camera;
    long x0 = (long)floorf(x - 0.5f), y0 = (long)floorf(y - 0.5f);
    for (long row = y0; row < y0 + 2; row++)
        for (long column = x0; column < x0 + 2; column++)
            if (column >= 0 && row >= 0 && column < (long)camera->width && row < (long)camera->height &&
                s->straddles[train][row * (long)camera->width + column])
                return true;
    return false;
}

static bool view_sees(const struct seen *s, size_t train, vec3 point, vec3 normal) {
    const struct camera *camera = &s->scene->photograph[s->train[train]].camera;
    float x, y, depth;
    if (!camera_project(camera, point, &x, &y, &depth) || on_edge(s, train, x, y))
        return false;
    vec3 to_camera = vec3_sub(camera_origin(camera), point);
    float distance = vec3_length(to_camera);
    vec3 direction = vec3_scale(to_camera, 1.0f / distance);
    return !accel_occluded(s->accel, accel_offset(point, normal, direction), direction, 0.0f, distance);
}

/* Starts with the view that saw the previous point, which is close. */
static bool is_seen(const struct seen *s, vec3 point, vec3 normal, size_t *last) {
    for (size_t i = 0; i < s->train_count; i++) {
        size_t train = (*last + i) % s->train_count;
        if (view_sees(s, train, point, normal)) {
            *last = train;
            return true;
        }
    }
    return false;
}

/* Sample position on a jittered 4 x 4 grid. */
static vec2 sample_place(uint32_t x, uint32_t y, uint32_t sample) {
    uint64_t bits = rng_key(x, y, sample);
    return vec2_make((float)x + ((float)(sample % 4) + rng_to_float((uint32_t)bits)) / 4.0f,
                     (float)y + ((float)(sample / 4) + rng_to_float((uint32_t)(bits >> 32))) / 4.0f);
}

static uint8_t pixel_flags(const struct flag_job *job, uint32_t x, uint32_t y, size_t *last) {
    const struct seen *s = job->seen;
    const struct mesh *mesh = &s->scene->mesh;
    uint8_t flags = SCORE_PLAIN | SCORE_SEEN;
    vec3 origin = camera_origin(job->camera);
    for (uint32_t i = 0; i < SEEN_SAMPLES; i++) {
        vec2 place = sample_place(x, y, i);
        vec3 direction;
        struct accel_hit hit;
        if (!camera_direction(job->camera, place.x, place.y, &direction) ||
            !accel_intersect(s->accel, origin, direction, 0.0f, INFINITY, &hit) || s->emits[hit.triangle])
            return 0;
        if (flags & SCORE_SEEN) {
            vec3 point = mesh_point(mesh, hit.triangle, hit.b1, hit.b2);
            vec3 normal = vec3_normalize(mesh_cross(mesh, hit.triangle));
            if (!is_seen(s, point, normal, last))
                flags = SCORE_PLAIN;
        }
    }
    return flags;
}

static void flag_row(void *user, size_t row, int thread) {
    const struct flag_job *job = user;
    uint32_t width = job->camera->width, y = (uint32_t)row;
    size_t last = 0;
    (void)thread;
    for (uint32_t x = 0; x < width; x++)
        job->flags[(size_t)y * width + x] = pixel_flags(job, x, y, &last);
}

void seen_flags(const struct seen *seen, const struct camera *camera, struct parallel *pool, uint8_t *flags) {
    struct flag_job job = {seen, camera, flags};
    parallel_for(pool, camera->height, flag_row, &job);
}
