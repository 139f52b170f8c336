/* observe.c -- see observe.h. */
#include "server/reconstruct/observe.h"

#include <math.h>

#include "common/image.h"
#include "common/mem.h"

/* Radiance that is added before the logarithm, as a share of the median: black stays finite. */
#define LOG_FLOOR 0.01f
#define CHUNK 1024 /* valid texels a work item */

struct observe_job {
    struct observed *o;
    const struct views *views;
    const struct atlas *atlas;
    const struct inverse_uv *inverse;
};

/* Running sums over the photographs of one texel. */
struct sums {
    double weight, log_radiance[3];
    double count, gray, gray_squared; /* of the logarithm of the mean of the channels */
};

static void add_view(const struct observe_job *job, const struct view *view, struct sums *s) {
    const struct views *v = job->views;
    float floor_radiance = LOG_FLOOR * v->median_radiance;
    struct photograph_sample sample;
    if (!views_clean(v, view) ||
        !photograph_sample(&v->scene->photograph[v->train[view->train]], view->x, view->y, &sample))
        return;
    double gray = log((double)fmaxf(rgb_mean(sample.radiance), 0.0f) + (double)floor_radiance);
    s->count += 1.0;
    s->gray += gray;
    s->gray_squared += gray * gray;
    if (sample.saturated[0] || sample.saturated[1] || sample.saturated[2])
        return;
    double w = (double)view->weight;
    s->weight += w;
    s->log_radiance[0] += w * log((double)(fmaxf(sample.radiance.r, 0.0f) + floor_radiance));
    s->log_radiance[1] += w * log((double)(fmaxf(sample.radiance.g, 0.0f) + floor_radiance));
    s->log_radiance[2] += w * log((double)(fmaxf(sample.radiance.b, 0.0f) + floor_radiance));
}

static void observe_texel(const struct observe_job *job, uint32_t texel) {
    uint32_t triangle;
    float b1, b2;
    const struct mesh *mesh = &job->views->scene->mesh;
    if (!inverse_uv_lookup(job->inverse, job->atlas, (float)(texel % job->o->width) + 0.5f,
                           (float)(texel / job->o->width) + 0.5f, &triangle, &b1, &b2))
        return;
    vec3 point = mesh_point(mesh, triangle, b1, b2);
    vec3 normal = vec3_normalize(mesh_cross(mesh, triangle));
    struct sums s = {0};
    for (uint32_t t = 0; t < job->views->train_count; t++) {
        struct view view;
        if (views_sees(job->views, t, point, normal, &view))
            add_view(job, &view, &s);
    }
    job->o->count[texel] = (float)s.count;
    if (s.count > 1.0) {
        double variance = (s.gray_squared - s.gray * s.gray / s.count) / (s.count - 1.0);
        job->o->spread[texel] = (float)sqrt(fmax(0.0, variance));
    }
    for (int c = 0; c < 3 && s.weight > 0.0; c++) {
        double radiance = exp(s.log_radiance[c] / s.weight);
        job->o->radiance[texel][c] = image_half_from_float((float)radiance);
    }
}

static void observe_chunk(void *user, size_t chunk, int thread) {
    (void)thread;
    const struct observe_job *job = user;
    size_t end = (chunk + 1) * CHUNK;
    end = end < job->inverse->valid_count ? end : job->inverse->valid_count;
    for (size_t i = chunk * CHUNK; i < end; i++)
        observe_texel(job, job->inverse->valid[i]);
}

void observed_make(struct observed *o, const struct views *views, const struct atlas *atlas,
                   const struct inverse_uv *inverse, struct parallel *pool) {
    size_t texels = (size_t)inverse->width * inverse->height;
    *o = (struct observed){.width = inverse->width, .height = inverse->height};
    o->radiance = mem_calloc_large(texels, sizeof *o->radiance);
    o->count = mem_calloc_large(texels, sizeof *o->count);
    o->spread = mem_calloc_large(texels, sizeof *o->spread);
    struct observe_job job = {o, views, atlas, inverse};
    parallel_for(pool, (inverse->valid_count + CHUNK - 1) / CHUNK, observe_chunk, &job);
}

void observed_release(struct observed *o) {
    mem_free(o->radiance);
    mem_free(o->count);
    mem_free(o->spread);
    *o = (struct observed){0};
}
