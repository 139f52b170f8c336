/* pass.c -- see pass.h. */
#include "server/refine/pass.h"

#include <string.h>

#include "common/mem.h"
#include "server/refine/loss.h"

void pass_init(struct pass *p, const struct surface *surface, const struct world *world, const struct views *views,
               const struct settings *set, const struct path_settings *path, struct parallel *pool) {
    *p = (struct pass){.surface = *surface, .views = views, .pool = pool};
    p->by_pixels = settings_is(set, "choose", "pixels");
    p->one_estimate = settings_is(set, "estimates", "one");
    stratified_init(&p->strata, surface->inverse->valid_count, (size_t)settings_number(set, "texels_per_iteration"),
                    path->seed);
    int threads = parallel_thread_count(pool);
    p->batch = mem_calloc((size_t)threads, sizeof *p->batch);
    for (int t = 0; t < threads; t++)
        observation_batch_init(&p->batch[t], surface, world, views, path,
                               (int)settings_number(set, "cameras_per_texel"),
                               (int)settings_number(set, "samples_per_camera"), PASS_CHUNK_TEXELS);
    p->observation_capacity = p->batch[0].observation_capacity;
    p->chunk_count = (p->strata.stratum_count + PASS_CHUNK_TEXELS - 1) / PASS_CHUNK_TEXELS;
    p->chunk = mem_calloc(p->chunk_count, sizeof *p->chunk);
    for (size_t c = 0; c < p->chunk_count; c++)
        p->chunk[c].emission = mem_array(p->observation_capacity, sizeof *p->chunk[c].emission);
}

void pass_release(struct pass *p) {
    for (size_t c = 0; c < p->chunk_count; c++)
        mem_free(p->chunk[c].emission);
    mem_free(p->chunk);
    for (int t = 0; t < parallel_thread_count(p->pool); t++)
        observation_batch_release(&p->batch[t]);
    mem_free(p->batch);
    *p = (struct pass){0};
}

struct pass_job {
    struct pass *pass;
    uint64_t iteration;
    pass_visit *visit;
    void *user;
};

static void choose_observations(const struct pass *p, size_t chunk, uint64_t iteration, struct observation_batch *b) {
    observation_batch_clear(b);
    size_t end = (chunk + 1) * PASS_CHUNK_TEXELS;
    for (size_t i = chunk * PASS_CHUNK_TEXELS; i < end && i < p->strata.stratum_count; i++) {
        size_t item = stratified_item(&p->strata, iteration, i);
        if (p->by_pixels)
            observation_add_pixels(b, i, iteration);
        else if (item != STRATIFIED_NONE)
            observation_add(b, p->surface.inverse->valid[item], iteration);
    }
}

/* Compares observation k with its photograph; returns the loss. */
static float compare(const struct pass *p, struct observation_batch *b, size_t k, struct pass_emission *emission) {
    const struct observation *observation = &b->observation[k];
    size_t first = k * (size_t)b->samples;
    rgb *d_radiance = b->d_radiance + first;
    float loss = loss_pair(observation->photograph, b->reference + first, b->radiance + first, b->samples,
                           p->one_estimate, p->views->median_radiance, d_radiance);
    *emission = (struct pass_emission){.segment = observation->segment};
    for (int i = 0; i < b->samples; i++) {
        d_radiance[i] = rgb_scale(d_radiance[i], observation->weight);
        emission->d_radiance = rgb_add(emission->d_radiance, d_radiance[i]);
    }
    return loss;
}

static void run_chunk(void *user, size_t number, int thread) {
    const struct pass_job *job = user;
    struct pass *p = job->pass;
    struct pass_chunk *chunk = &p->chunk[number];
    struct observation_batch *b = &p->batch[thread];
    choose_observations(p, number, job->iteration, b);
    observation_trace(b);
    chunk->loss = 0.0;
    chunk->observation_count = b->observation_count;
    for (size_t k = 0; k < b->observation_count; k++)
        chunk->loss += (double)compare(p, b, k, &chunk->emission[k]);
    job->visit(job->user, number, b);
}

void pass_run(struct pass *p, uint64_t iteration, pass_visit *visit, void *user) {
    struct pass_job job = {p, iteration, visit, user};
    parallel_for(p->pool, p->chunk_count, run_chunk, &job);
}

size_t pass_observation_count(const struct pass *p) {
    size_t observations = 0;
    for (size_t c = 0; c < p->chunk_count; c++)
        observations += p->chunk[c].observation_count;
    return observations;
}

double pass_mean_loss(const struct pass *p) {
    size_t observations = pass_observation_count(p);
    double loss = 0.0;
    for (size_t c = 0; c < p->chunk_count; c++)
        loss += p->chunk[c].loss;
    return observations ? loss / (double)observations : 0.0;
}

void pass_d_emission(const struct pass *p, double (*d_radiance)[3]) {
    memset(d_radiance, 0, p->surface.segments->count * sizeof *d_radiance);
    for (size_t c = 0; c < p->chunk_count; c++) {
        const struct pass_chunk *chunk = &p->chunk[c];
        for (size_t k = 0; k < chunk->observation_count; k++) {
            double *d = d_radiance[chunk->emission[k].segment];
            d[0] += (double)chunk->emission[k].d_radiance.r;
            d[1] += (double)chunk->emission[k].d_radiance.g;
            d[2] += (double)chunk->emission[k].d_radiance.b;
        }
    }
}

void pass_ray_counts(const struct pass *p, uint64_t *ray_count, uint64_t *dropped_count) {
    *ray_count = *dropped_count = 0;
    for (int t = 0; t < parallel_thread_count(p->pool); t++) {
        uint64_t rays, dropped;
        path_batch_counts(p->batch[t].paths, &rays, &dropped);
        *ray_count += rays;
        *dropped_count += dropped;
    }
}
