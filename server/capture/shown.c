/* shown.c -- see shown.h. */
#include "server/capture/shown.h"

#include <math.h>
#include <stdatomic.h>

#include "common/mem.h"

#define STRIDE 2 /* pixels, of those that are asked */
/* Texels a metre of what nobody sees: it has to send out light, which takes no detail. */
#define UNSEEN_DENSITY 0.25f

struct shown_job {
    const struct views *views;
    const struct atlas *atlas;
    atomic_bool *is_shown; /* [chart_count] */
};

static void look_at_photograph(void *user, size_t train, int thread) {
    (void)thread;
    const struct shown_job *job = user;
    const struct camera *camera = &job->views->scene->photograph[job->views->train[train]].camera;
    for (uint32_t y = STRIDE / 2; y < camera->height; y += STRIDE) {
        for (uint32_t x = STRIDE / 2; x < camera->width; x += STRIDE) {
            vec3 direction;
            struct accel_hit hit;
            if (camera_direction(camera, (float)x + 0.5f, (float)y + 0.5f, &direction) &&
                accel_intersect(job->views->accel, camera_origin(camera), direction, 0.0f, INFINITY, &hit))
                atomic_store(&job->is_shown[job->atlas->chart_of_triangle[hit.triangle]], true);
        }
    }
}

void shown_density(const struct views *views, const struct atlas *atlas, struct parallel *pool, float *density) {
    struct shown_job job = {views, atlas, mem_calloc(atlas->chart_count, sizeof *job.is_shown)};
    parallel_for(pool, views->train_count, look_at_photograph, &job);
    for (size_t i = 0; i < views->scene->mesh.triangle_count; i++)
        density[i] = job.is_shown[atlas->chart_of_triangle[i]] ? 1.0f : UNSEEN_DENSITY;
    mem_free(job.is_shown);
}
