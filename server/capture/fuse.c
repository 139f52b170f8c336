/* fuse.c -- see fuse.h. */
#include "server/capture/fuse.h"

#include <math.h>

#include "common/image.h"
#include "common/mem.h"
#include "server/capture/robust.h"
#include "server/capture/top_k.h"
#include "server/scene/surface.h"

/* Radiance added before a logarithm, as a share of the median: keeps black finite. */
#define LOG_FLOOR 0.01f /* +25 %: 0 dB */
/* Scale of the Cauchy weight: difference of log radiance from the median that halves a weight: 35 %.
 * What is twice as bright has a sixth. */
#define OUTLIER_SCALE 0.3f /* +25 %: 0 dB */
/* Noise of a bilinear look-up over that of a pixel, on average: the root of the mean sum of squared weights, 2/3, for
 * independent noise. */
#define BILINEAR_DEVIATION 0.67f /* +25 %: 0 dB */
/* Observations that a mean uses at most, those of the greatest weights; bounds the stack of a thread. Beyond 256 a
 * mean's noise is a sixteenth of one photograph's, and errors that all share are larger. */
#define MAX_OBSERVATIONS 256 /* +25 %: no change */
#define CHUNK 1024           /* valid texels a work item */

struct fuse_job {
    struct fused *f;
    const struct views *views;
    const struct noise *noise;
    const struct atlas *atlas;
    const struct inverse_uv *inverse;
};

/* Observations of a texel: the best of those that measured it or, where none did, of the lower bounds. */
struct fuse_observations {
    bool is_measured;
    struct top_k best;
    struct top_k_item item[MAX_OBSERVATIONS];
    struct robust_sample observation[MAX_OBSERVATIONS];
    struct view view[MAX_OBSERVATIONS];
    float mixing[MAX_OBSERVATIONS]; /* see views_mixing */
    size_t seen, clean;             /* over all photographs, as the next */
    double gray_sum, gray_square_sum;
};

/* Adds an observation; the first measured one discards the lower bounds before it. */
static void add_observation(const struct fuse_job *job, struct fuse_observations *l, const struct photograph_sample *s,
                            const struct view *view, uint32_t triangle) {
    const struct views *v = job->views;
    bool is_measured = !photograph_sample_saturates(s);
    float gray = logf(fmaxf(rgb_mean(s->radiance), 0.0f) + LOG_FLOOR * v->median_radiance);
    int edge = views_edge(v, view, triangle);
    l->seen++;
    l->clean += edge < VIEWS_EDGE;
    l->gray_sum += (double)gray;
    l->gray_square_sum += (double)gray * (double)gray;
    if (is_measured && !l->is_measured)
        top_k_init(&l->best, l->item, MAX_OBSERVATIONS);
    l->is_measured |= is_measured;
    if (is_measured != l->is_measured)
        return;
    /* Noise at the same radiance for all photographs: by their own values bright noise would be preferred. */
    float weight = view->weight * views_edge_weight(v, view, triangle);
    size_t slot = top_k_put(&l->best, weight * noise_weight(job->noise, v, view, rgb_gray(v->median_radiance), 0.0f),
                            view->train);
    if (slot == TOP_K_NONE)
        return;
    l->observation[slot] = (struct robust_sample){.value = s->radiance, .gray = gray, .weight = weight};
    l->view[slot] = *view;
    l->mixing[slot] = views_mixing(v, view, triangle, s->radiance);
}

/* Weighs observations by their noise, which depends on the texel's brightness: the mean of all, weighted by exposure.
 */
static void weigh_by_noise(const struct fuse_job *job, struct fuse_observations *l) {
    size_t count = l->best.count;
    rgb sum = {0.0f, 0.0f, 0.0f};
    float weights = 0.0f;
    for (size_t i = 0; i < count; i++) {
        float weight =
            l->observation[i].weight * job->views->scene->photograph[job->views->train[l->view[i].train]].exposure;
        sum = rgb_mad(sum, weight, l->observation[i].value);
        weights += weight;
    }
    rgb mean = rgb_scale(sum, 1.0f / weights);
    float floor_radiance = LOG_FLOOR * job->views->median_radiance;
    for (size_t i = 0; i < count; i++) {
        rgb deviation = noise_deviation(job->noise, job->views, &l->view[i], mean);
        l->observation[i].deviation = BILINEAR_DEVIATION * rgb_mean(deviation) / (rgb_mean(mean) + floor_radiance);
        float times_mean = rgb_mean(l->observation[i].value) / (rgb_mean(mean) + floor_radiance);
        l->observation[i].weight *=
            noise_weight(job->noise, job->views, &l->view[i], mean, l->mixing[i] * times_mean * times_mean);
    }
}

static void observe_all(const struct fuse_job *job, const struct surface_point *p, struct fuse_observations *l) {
    const struct views *v = job->views;
    float texel_m2 = surface_texel_m2(&v->scene->mesh, job->atlas, p->triangle);
    l->is_measured = false;
    l->seen = l->clean = 0;
    l->gray_sum = l->gray_square_sum = 0.0;
    top_k_init(&l->best, l->item, MAX_OBSERVATIONS);
    for (uint32_t t = 0; t < v->train_count; t++) {
        const struct photograph *photo = &v->scene->photograph[v->train[t]];
        struct view view;
        struct photograph_sample s;
        if (!views_sees(v, t, p->position, p->normal, &view) || photograph_has_firefly(photo, view.x, view.y) ||
            !photograph_sample(photo, view.x, view.y, &s))
            continue;
        views_weigh(v, texel_m2, &view);
        add_observation(job, l, &s, &view, p->triangle);
    }
}

static float spread_of(const struct fuse_observations *l) {
    double n = (double)l->seen, sum = l->gray_sum;
    return n > 1.0 ? (float)sqrt(fmax(0.0, (l->gray_square_sum - sum * sum / n) / (n - 1.0))) : 0.0f;
}

static void fuse_texel(const struct fuse_job *job, uint32_t texel) {
    struct surface_point p;
    struct fuse_observations l;
    if (!surface_at_texel(&job->views->scene->mesh, job->atlas, job->inverse, texel, &p))
        return;
    observe_all(job, &p, &l);
    if (l.best.count == 0)
        return;
    job->f->count[texel] = (float)l.clean;
    job->f->spread[texel] = spread_of(&l);
    job->f->is_bound[texel] = !l.is_measured;
    weigh_by_noise(job, &l);
    rgb mean = robust_mean(l.observation, l.best.count, OUTLIER_SCALE);
    const float channel[3] = {mean.r, mean.g, mean.b};
    for (int c = 0; c < 3; c++)
        job->f->radiance[texel][c] = image_half_from_float(fmaxf(channel[c], 0.0f));
}

static void fuse_chunk(void *user, size_t chunk, int thread) {
    (void)thread;
    const struct fuse_job *job = user;
    size_t end = (chunk + 1) * CHUNK;
    end = end < job->inverse->valid_count ? end : job->inverse->valid_count;
    for (size_t i = chunk * CHUNK; i < end; i++)
        fuse_texel(job, job->inverse->valid[i]);
}

void fuse(struct fused *f, const struct views *views, const struct noise *noise, const struct atlas *atlas,
          const struct inverse_uv *inverse, struct parallel *pool) {
    size_t texels = (size_t)inverse->width * inverse->height;
    *f = (struct fused){.width = inverse->width, .height = inverse->height};
    f->radiance = mem_calloc_large(texels, sizeof *f->radiance);
    f->count = mem_calloc_large(texels, sizeof *f->count);
    f->spread = mem_calloc_large(texels, sizeof *f->spread);
    f->is_bound = mem_calloc_large(texels, sizeof *f->is_bound);
    struct fuse_job job = {f, views, noise, atlas, inverse};
    parallel_for(pool, (inverse->valid_count + CHUNK - 1) / CHUNK, fuse_chunk, &job);
}

void fused_release(struct fused *f) {
    mem_free(f->radiance);
    mem_free(f->count);
    mem_free(f->spread);
    mem_free(f->is_bound);
    *f = (struct fused){0};
}

rgb fused_around(const struct fused *f, const struct atlas *atlas, const struct inverse_uv *inverse, uint32_t texel,
                 uint32_t around) {
    uint32_t x0 = texel % f->width, y0 = texel / f->width, chart = atlas->chart_of_triangle[inverse->triangle[texel]];
    rgb sum = {0.0f, 0.0f, 0.0f};
    float count = 0.0f;
    for (uint32_t y = y0 > around ? y0 - around : 0; y <= y0 + around && y < f->height; y++) {
        for (uint32_t x = x0 > around ? x0 - around : 0; x <= x0 + around && x < f->width; x++) {
            uint32_t at = y * f->width + x, triangle = inverse->triangle[at];
            if (triangle == INVERSE_UV_NONE || atlas->chart_of_triangle[triangle] != chart || f->is_bound[at])
                continue;
            sum = rgb_mad(sum, f->count[at], fused_radiance(f, at));
            count += f->count[at];
        }
    }
    return count > 0.0f ? rgb_scale(sum, 1.0f / count) : sum;
}
