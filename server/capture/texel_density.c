/* texel_density.c -- see texel_density.h. */
#include "server/capture/texel_density.h"

#include <math.h>
#include <stdatomic.h>

#include "common/mem.h"
#include "server/scene/photograph_reduce.h"

/* Along both axes, of the pixels traced, for time: what is seen at all covers more. Of large photographs as many times
 * camera_step. */
#define PIXEL_STRIDE 2 /* to 3: +0.58 dB, roughness +0.15, specular +0.12 */
struct density_job {
    const struct views *views;
    const struct atlas *atlas;
    atomic_bool *is_seen; /* [chart_count] */
};

static void mark_seen_charts(void *user, size_t train, int thread) {
    (void)thread;
    const struct density_job *job = user;
    const struct camera *camera = &job->views->scene->photograph[job->views->train[train]].camera;
    uint32_t stride = PIXEL_STRIDE * camera_step(camera);
    for (uint32_t y = stride / 2; y < camera->height; y += stride) {
        for (uint32_t x = stride / 2; x < camera->width; x += stride) {
            vec3 direction;
            struct accel_hit hit;
            if (camera_direction(camera, (float)x + 0.5f, (float)y + 0.5f, &direction) &&
                accel_intersect(job->views->accel, camera_origin(camera), direction, 0.0f, INFINITY, &hit))
                atomic_store(&job->is_seen[job->atlas->chart_of_triangle[hit.triangle]], true);
        }
    }
}

void texel_density_from_views(const struct views *views, const struct atlas *atlas, struct parallel *pool,
                              float *density) {
    struct density_job job = {views, atlas, mem_calloc(atlas->chart_count, sizeof *job.is_seen)};
    parallel_for(pool, views->train_count, mark_seen_charts, &job);
    for (size_t i = 0; i < views->scene->mesh.triangle_count; i++)
        density[i] = job.is_seen[atlas->chart_of_triangle[i]] ? 1.0f : TEXEL_DENSITY_UNSEEN;
    mem_free(job.is_seen);
}
