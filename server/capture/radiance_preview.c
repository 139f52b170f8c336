/* radiance_preview.c -- see radiance_preview.h. */
#include "server/capture/radiance_preview.h"

#include "common/mem.h"
#include "server/scene/photograph.h"
#include "server/scene/rgb_half.h"
#include "server/scene/surface.h"

#define BLOCK 4 /* texels a side: a sixteenth of the work of fuse.c; to 5: no change */
/* Photographs used at most, evenly spaced: the first ones alone would show one end of the room. Time
 * is proportional; fuse.c takes all. */
#define MAX_PHOTOGRAPHS 64 /* +25 %: no change */

struct preview_job {
    uint16_t (*radiance)[3];
    const struct views *views;
    const struct atlas *atlas;
    const struct inverse_uv *inverse;
};

static rgb mean_observed(const struct views *v, const struct surface_point *p) {
    rgb sum = rgb_gray(0.0f);
    float weights = 0.0f;
    uint32_t every = (uint32_t)(v->train_count / MAX_PHOTOGRAPHS) + 1;
    for (uint32_t t = 0; t < v->train_count; t += every) {
        struct view view;
        struct photograph_sample s;
        if (!views_sees(v, t, p->position, p->normal, &view) ||
            !photograph_sample(&v->scene->photograph[v->train[t]], view.x, view.y, &s))
            continue;
        sum = rgb_mad(sum, view.weight, s.radiance);
        weights += view.weight;
    }
    return weights > 0.0f ? rgb_scale(sum, 1.0f / weights) : sum;
}

/* The first valid texel gives the value of its block. */
static void preview_block(const struct preview_job *job, uint32_t x0, uint32_t y0) {
    const struct inverse_uv *inverse = job->inverse;
    uint16_t value[3];
    bool has_value = false;
    for (uint32_t y = y0; y < y0 + BLOCK && y < inverse->height; y++) {
        for (uint32_t x = x0; x < x0 + BLOCK && x < inverse->width; x++) {
            uint32_t texel = y * inverse->width + x;
            struct surface_point p;
            if (inverse->triangle[texel] == INVERSE_UV_NONE)
                continue;
            if (!has_value) {
                if (!surface_at_texel(&job->views->scene->mesh, job->atlas, inverse, texel, &p))
                    continue;
                rgb_to_half(value, mean_observed(job->views, &p));
                has_value = true;
            }
            for (int c = 0; c < 3; c++)
                job->radiance[texel][c] = value[c];
        }
    }
}

static void preview_row(void *user, size_t row, int thread) {
    (void)thread;
    const struct preview_job *job = user;
    for (uint32_t x = 0; x < job->inverse->width; x += BLOCK)
        preview_block(job, x, (uint32_t)row * BLOCK);
}

uint16_t (*radiance_preview(const struct views *views, const struct atlas *atlas, const struct inverse_uv *inverse,
                            struct parallel *pool))[3] {
    struct preview_job job = {.views = views, .atlas = atlas, .inverse = inverse};
    job.radiance = mem_calloc_large((size_t)inverse->width * inverse->height, sizeof *job.radiance);
    parallel_for(pool, (inverse->height + BLOCK - 1) / BLOCK, preview_row, &job);
    return job.radiance;
}
