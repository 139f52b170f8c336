/* outlines.c -- see outlines.h. */
#include "server/reconstruct/outlines.h"

#include <math.h>

#include "common/mem.h"
#include "server/reconstruct/metrics.h"

/* Relative step of depth from a pixel to the next at an outline. A floor or a wall seen at 5 degrees has .03 (640
 * pixels, 60 degrees). */
#define STEP 0.1f

struct outline_depths {
    struct accel *accel;
    const struct camera *camera;
    float *depth;
};

static void depth_row(void *user, size_t y, int thread) {
    const struct outline_depths *m = user;
    const struct camera *camera = m->camera;
    (void)thread;
    for (uint32_t x = 0; x < camera->width; x++) {
        vec3 direction;
        struct accel_hit hit;
        float *depth = &m->depth[y * camera->width + x];
        *depth = INFINITY;
        if (!camera_direction(camera, (float)x + 0.5f, (float)y + 0.5f, &direction) ||
            !accel_intersect(m->accel, camera->world_from_camera.translation, direction, 0.0f, INFINITY, &hit))
            continue;
        bool is_panorama = camera->model == CAMERA_PANORAMA;
        *depth = hit.distance_m * (is_panorama ? 1.0f : rigid_direction(&camera->camera_from_world, direction).z);
    }
}

float *outlines_depth(struct accel *accel, const struct camera *camera, struct parallel *pool) {
    struct outline_depths map = {accel, camera, mem_array((size_t)camera->width * camera->height, sizeof(float))};
    parallel_for(pool, camera->height, depth_row, &map);
    return map.depth;
}

static bool is_step(float a, float b) {
    return isinf(a) != isinf(b) || (isfinite(a) && fabsf(a - b) > STEP * fminf(a, b));
}

/* Marks the pixels within reach of (x, y). */
static void mark_around(bool *beside, int64_t width, int64_t height, int64_t x, int64_t y) {
    for (int64_t v = y - OUTLINE_REACH; v <= y + OUTLINE_REACH; v++)
        for (int64_t u = x - OUTLINE_REACH; u <= x + OUTLINE_REACH; u++)
            if (u >= 0 && v >= 0 && u < width && v < height)
                beside[v * width + u] = true;
}

/* Around both sides of each step. */
static bool *find_outlines(const float *depth, uint32_t width, uint32_t height) {
    bool *beside = mem_calloc((size_t)width * height, sizeof *beside);
    for (uint32_t y = 0; y < height; y++) {
        for (uint32_t x = 0; x < width; x++) {
            const float *here = &depth[(size_t)y * width + x];
            bool right = x + 1 < width && is_step(here[0], here[1]);
            bool below = y + 1 < height && is_step(here[0], here[width]);
            if (right || below)
                mark_around(beside, width, height, x, y);
            if (right)
                mark_around(beside, width, height, x + 1, y);
            if (below)
                mark_around(beside, width, height, x, y + 1);
        }
    }
    return beside;
}

static bool counts(const struct image *photograph, const struct image *halves, size_t pixel) {
    const float *r = photograph->pixel + 3 * pixel, *v = halves->pixel + 6 * pixel;
    return isfinite(r[0] + r[1] + r[2]) && isfinite(v[0] + v[1] + v[2] + v[3] + v[4] + v[5]);
}

struct outline_error outlines_measure(const float *depth, const struct image *photograph, const struct image *halves,
                                      double median_radiance) {
    size_t all = 0, near = 0;
    bool *beside = find_outlines(depth, photograph->width, photograph->height);
    struct image part;
    image_copy(photograph, &part);
    for (size_t i = 0; i < (size_t)part.width * part.height; i++) {
        bool used = counts(photograph, halves, i);
        all += used;
        near += used && beside[i];
        if (!beside[i])
            part.pixel[3 * i] = NAN;
    }
    struct metric msre = metrics_msre(&part, halves, median_radiance);
    image_release(&part);
    mem_free(beside);
    if (all == 0)
        return (struct outline_error){(double)NAN, (double)NAN};
    double share = (double)near / (double)all;
    return (struct outline_error){near ? msre.value * share : 0.0, share};
}

struct outline_error outlines_of_view(struct accel *accel, const struct camera *camera, struct parallel *pool,
                                      const struct image *photograph, const struct image *halves,
                                      double median_radiance) {
    float *depth = outlines_depth(accel, camera, pool);
    struct outline_error error = outlines_measure(depth, photograph, halves, median_radiance);
    mem_free(depth);
    return error;
}
