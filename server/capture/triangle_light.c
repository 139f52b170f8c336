/* triangle_light.c -- see triangle_light.h. */
#include "server/capture/triangle_light.h"

#include <math.h>

#include "common/mem.h"
#include "server/capture/censored.h"
#include "server/render/sampler.h"

/* Photographs a point and points a triangle, at most: 48 observations, of which a quantile is off by 7 % of their
 * number. */
#define OBSERVATIONS_PER_POINT 6 /* to 7: no change */
#define MAX_POINTS 8             /* +25 %: no change */
/* Pixels of a triangle for each point: 4 x 4, whose look-ups share none. */
#define PIXELS_PER_POINT 16.0f /* +25 %: no change */
/* Share of observations that reach the value: so many must agree that it is as bright; the rest may be occluded or
 * beside it, as poses are not calibrated yet. */
#define BRIGHTER_SHARE 0.7f /* +25 %: no change */
#define KEY_POINTS 29       /* separates these random numbers from others of the triangle */

struct triangle_light_job {
    const struct views *views;
    struct triangle_light *light;
};

/* Observations of one triangle. */
struct triangle_observations {
    struct censored value[MAX_POINTS * OBSERVATIONS_PER_POINT];
    size_t count, clipped_count; /* in all channels */
    float pixels;                /* sum over observations of the pixels that the whole triangle fills */
};

/* The i-th point: the centroid, then points evenly distributed by area. */
static vec3 place(const struct mesh *mesh, uint32_t triangle, uint32_t i) {
    if (i == 0)
        return mesh_point(mesh, triangle, 1.0f / 3.0f, 1.0f / 3.0f);
    vec2 u = sampler_pair(sampler_key(KEY_POINTS, triangle, 0), i, 0);
    float root = sqrtf(u.x);
    return mesh_point(mesh, triangle, root * (1.0f - u.y), root * u.y);
}

static void observe_point(const struct views *views, uint32_t triangle, vec3 point, vec3 cross,
                          struct triangle_observations *observations) {
    struct view view[OBSERVATIONS_PER_POINT];
    float area = 0.5f * vec3_length(cross);
    size_t seen = views_pick(views, point, vec3_normalize(cross), triangle, OBSERVATIONS_PER_POINT, view);
    for (size_t k = 0; k < seen; k++) {
        const struct photograph *photo = &views->scene->photograph[views->train[view[k].train]];
        struct photograph_sample s;
        if (!views_clean(views, &view[k]) || !photograph_sample(photo, view[k].x, view[k].y, &s))
            continue;
        bool saturated = photograph_sample_saturates(&s);
        observations->value[observations->count++] =
            (struct censored){fmaxf(rgb_mean(s.radiance), 0.0f), 1.0f, saturated};
        observations->clipped_count += s.saturated[0] && s.saturated[1] && s.saturated[2];
        observations->pixels += area * view[k].weight * photo->camera.fx * photo->camera.fy;
    }
}

/* Mean of measured values, or of lower bounds where there is none. */
static float mean_of(const struct triangle_observations *observations, bool *is_bound) {
    float sum[2] = {0.0f, 0.0f}, count[2] = {0.0f, 0.0f};
    for (size_t i = 0; i < observations->count; i++) {
        sum[observations->value[i].is_bound] += observations->value[i].value;
        count[observations->value[i].is_bound] += 1.0f;
    }
    *is_bound = count[false] == 0.0f;
    return sum[*is_bound] / count[*is_bound];
}

static void measure(void *user, size_t index, int thread) {
    (void)thread;
    const struct triangle_light_job *job = user;
    const struct mesh *mesh = &job->views->scene->mesh;
    uint32_t triangle = (uint32_t)index, points = 1;
    vec3 cross = mesh_cross(mesh, triangle);
    struct triangle_observations observations = {.count = 0};
    for (uint32_t i = 0; i < points; i++) {
        observe_point(job->views, triangle, place(mesh, triangle, i), cross, &observations);
        float pixels = observations.count > 0 ? observations.pixels / (float)observations.count : 0.0f;
        if (i == 0)
            points = (uint32_t)clampf(pixels / PIXELS_PER_POINT, 1.0f, MAX_POINTS);
    }
    struct triangle_light *light = job->light;
    light->observed[triangle] = light->mean[triangle] = -1.0f;
    light->pixels[triangle] = 0.0f;
    if (observations.count == 0)
        return;
    bool is_bound;
    light->mean[triangle] = mean_of(&observations, &light->is_bound[triangle]);
    light->observed[triangle] =
        censored_quantile(observations.value, observations.count, 1.0f - BRIGHTER_SHARE, &is_bound);
    light->pixels[triangle] = observations.pixels / (float)observations.count;
    light->is_clipped[triangle] = light->is_bound[triangle] && 2 * observations.clipped_count > observations.count;
}

void triangle_light_measure(struct triangle_light *light, const struct views *views, struct parallel *pool) {
    size_t count = views->scene->mesh.triangle_count;
    light->observed = mem_array(count, sizeof *light->observed);
    light->mean = mem_array(count, sizeof *light->mean);
    light->pixels = mem_array(count, sizeof *light->pixels);
    light->is_bound = mem_calloc(count, sizeof *light->is_bound);
    light->is_clipped = mem_calloc(count, sizeof *light->is_clipped);
    struct triangle_light_job job = {views, light};
    parallel_for(pool, count, measure, &job);
}

void triangle_light_release(struct triangle_light *light) {
    mem_free(light->observed);
    mem_free(light->mean);
    mem_free(light->pixels);
    mem_free(light->is_clipped);
    mem_free(light->is_bound);
    *light = (struct triangle_light){0};
}
