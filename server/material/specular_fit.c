/* specular_fit.c -- see specular_fit.h. */
#include "server/material/specular_fit.h"

#include <math.h>

#include "common/mem.h"
#include "server/material/specular_misfit.h"
#include "server/material/specular_observation.h"
#include "server/material/specular_points.h"
#include "server/material/specular_posterior.h"

/* Probability from which a segment is diffuse; below, the posterior mean has the smaller error. */
#define DIFFUSE_CERTAIN 0.95 /* +25 %: 0 dB */

#define ROUGHNESSES HIGHLIGHT_ROUGHNESSES
#define SPECULARS SPECULAR_LEVELS

static const float specular_of[SPECULARS] = {0.0f, 0.125f, 0.25f, 0.5f, 0.75f, 1.0f};

static const struct specular_candidate_levels diffuse_candidate = {ROUGHNESSES - 1, 0};

/* A sample to be fitted. */
struct fitted_sample {
    uint32_t sample;
    size_t first_residual; /* of its observations */
};

struct specular_job {
    const bool *is_emitter; /* [segment_count]; borrowed, both */
    struct materials *materials;
    struct specular_observer observer;
    struct segment_points *points;  /* [segment_count]; owned */
    struct specular_sample *sample; /* of all segments; owned */
    struct fitted_sample *used;     /* [used_count] in the order of the segments; owned */
    size_t used_count;
    specular_residuals *residual;       /* of all observations of these; owned */
    struct specular_evidence *evidence; /* [segment_count]; owned */
};

/* --- misfits ------------------------------------------------------------------------------------ */

/* One sample is the unit of parallel work: it takes some milliseconds, a segment up to a thousand times as long. */
static void find_misfits(void *user, size_t index, int thread) {
    const struct specular_job *job = user;
    const struct specular_sample *s = &job->sample[job->used[index].sample];
    struct specular_prediction prediction[SPECULAR_VIEWS];
    specular_predict(&job->observer, s, thread, prediction);
    specular_misfit_find(s, prediction, job->observer.in.views->median_radiance,
                         &job->residual[job->used[index].first_residual]);
}

/* The candidate of the least misfit. */
static struct specular_candidate_levels best_of(const struct specular_points *e) {
    struct specular_candidate_levels best = diffuse_candidate;
    double least = specular_misfit_sum(e, diffuse_candidate);
    for (size_t k = 0; k < ROUGHNESSES && specular_levels.roughness[k] <= SPECULAR_MAX_ROUGHNESS; k++) {
        for (size_t m = 1; m < SPECULARS; m++) {
            struct specular_candidate_levels c = {k, m};
            double misfit = specular_misfit_sum(e, c);
            if (misfit < least)
                best = c, least = misfit;
        }
    }
    return best;
}

/* Likelihood of the observations under a candidate, relative to the best one: its excess misfit as a normal deviate. */
static double likelihood(const struct specular_points *e, struct specular_candidate_levels c,
                         struct specular_candidate_levels best) {
    double errors = specular_misfit_gain(e, c, best).errors;
    return errors > 0.0 ? exp(-0.5 * errors * errors) : 1.0;
}

/* --- segments ----------------------------------------------------------------------------------- */

/* Over the observed texels of a segment: the mean, and the deviation of the cube root. */
static void measure_color(const struct specular_observer *l, const struct texture *base_color, size_t segment,
                          rgb *mean, rgb *spread) {
    double sum[3] = {0.0}, roots[3] = {0.0}, squares[3] = {0.0}, count = 0.0;
    for (uint32_t i = l->texels.first[segment]; i < l->texels.first[segment + 1]; i++) {
        uint32_t texel = l->texels.texel[i];
        if (!(l->in.fused->count[texel] > 0.0f))
            continue;
        for (size_t c = 0; c < 3; c++) {
            double value = (double)base_color->texel[texel][c], root = cbrt(value);
            sum[c] += value;
            roots[c] += root;
            squares[c] += root * root;
        }
        count += 1.0;
    }
    double scale = 1.0 / fmax(count, 1.0);
    for (size_t c = 0; c < 3; c++) {
        double root = scale * roots[c];
        (&mean->r)[c] = (float)(scale * sum[c]);
        (&spread->r)[c] = (float)sqrt(fmax(0.0, scale * squares[c] - root * root));
    }
}

/* Offset in [-0.5, 0.5] of the minimum of a parabola through three values of which the middle one is least. */
static double between(double left, double middle, double right) {
    double bend = left - 2.0 * middle + right, offset = bend > 0.0 ? 0.5 * (left - right) / bend : 0.0;
    return offset < -0.5 ? -0.5 : offset > 0.5 ? 0.5 : offset;
}

/* Roughness of the best candidate, refined between the levels. */
static double roughness_about(const struct specular_points *e, struct specular_candidate_levels best) {
    const float *level = specular_levels.roughness;
    size_t k = best.k, m = best.m;
    double middle = (double)level[k];
    if (m == 0 || k == 0 || k + 1 == ROUGHNESSES)
        return middle;
    double offset =
        between(specular_misfit_sum(e, (struct specular_candidate_levels){k - 1, m}), specular_misfit_sum(e, best),
                specular_misfit_sum(e, (struct specular_candidate_levels){k + 1, m}));
    return middle + offset * (offset < 0.0 ? middle - (double)level[k - 1] : (double)level[k + 1] - middle);
}

static void set_evidence(const struct specular_job *job, size_t segment, const struct specular_points *e) {
    const struct specular_observer *l = &job->observer;
    struct specular_evidence *evidence = &job->evidence[segment];
    struct specular_candidate_levels best = best_of(e);
    evidence->is_observed = true;
    evidence->part = (double)by_segment_count(&l->texels, segment) / (double)l->in.surface.inverse->valid_count;
    measure_color(l, &job->materials->base_color, segment, &evidence->base_color, &evidence->color_spread);
    evidence->best = best.m == 0 ? SPECULAR_DIFFUSE : specular_candidate(best.k, best.m - 1);
    evidence->best_roughness = roughness_about(e, best);
    evidence->likelihood[SPECULAR_DIFFUSE] = likelihood(e, diffuse_candidate, best);
    for (size_t k = 0; k < ROUGHNESSES; k++)
        for (size_t m = 1; m < SPECULARS; m++)
            evidence->likelihood[specular_candidate(k, m - 1)] =
                likelihood(e, (struct specular_candidate_levels){k, m}, best);
}

/* Posterior of a segment without clean observations. It may be darker than the guess allows, which reflects a window at
 * grazing angles. This is one-sided: base colour explains anything brighter. */
static struct specular_posterior posterior_unobserved(const struct specular_points *e) {
    struct specular_candidate_levels guess = {0, 0};
    while (specular_levels.roughness[guess.k] < SPECULAR_UNKNOWN_ROUGHNESS)
        guess.k++;
    while (specular_of[guess.m] < SPECULAR_UNKNOWN_SPECULAR)
        guess.m++;
    return specular_posterior_unobserved(e->count > 0 ? specular_misfit_gain(e, diffuse_candidate, guess).errors : 0.0);
}

static void measure_segment(void *user, size_t segment, int thread) {
    const struct specular_job *job = user;
    (void)thread;
    if (job->points[segment].is_observed)
        set_evidence(job, segment, &job->points[segment].points);
}

static void fit_segment(void *user, size_t segment, int thread) {
    const struct specular_job *job = user;
    struct specular_posterior posterior = {1.0, 1.0, 0.0};
    (void)thread;
    if (job->evidence[segment].is_observed)
        posterior = specular_posterior(job->evidence, job->observer.in.surface.segments->count, segment);
    else if (!job->is_emitter[segment])
        posterior = posterior_unobserved(&job->points[segment].points);
    bool is_diffuse = posterior.diffuse > DIFFUSE_CERTAIN;
    job->materials->roughness[segment] = is_diffuse ? 1.0f : (float)posterior.roughness;
    job->materials->specular[segment] = is_diffuse ? 0.0f : (float)posterior.specular;
}

/* Room for the samples of all segments. */
static void make_room(struct specular_job *job, size_t segments) {
    size_t total = 0, first = 0;
    for (size_t i = 0; i < segments; i++)
        total += specular_points_wanted(&job->observer, i);
    job->points = mem_calloc(segments, sizeof *job->points);
    job->sample = mem_array(total, sizeof *job->sample);
    job->used = mem_array(total, sizeof *job->used);
    for (size_t i = 0; i < segments; i++) {
        job->points[i].points.sample = &job->sample[first];
        job->points[i].points.median = job->observer.in.views->median_radiance;
        first += specular_points_wanted(&job->observer, i);
    }
}

/* Lists the samples that were observed, and makes room for their misfits. */
static void list_used(struct specular_job *job, size_t segments) {
    size_t observations = 0;
    for (size_t i = 0; i < segments; i++) {
        const struct specular_points *e = &job->points[i].points;
        for (size_t k = 0; k < e->count; k++) {
            uint32_t sample = (uint32_t)(e->sample - job->sample + (ptrdiff_t)k);
            job->used[job->used_count++] = (struct fitted_sample){sample, observations};
            observations += e->sample[k].count;
        }
    }
    job->residual = mem_array(observations + 1, sizeof *job->residual);
    for (size_t i = 0, at = 0; i < segments; at += job->points[i++].points.count)
        job->points[i].points.residual =
            &job->residual[at < job->used_count ? job->used[at].first_residual : observations];
}

void specular_fit(const struct specular_input *input, const bool *is_emitter, struct materials *materials,
                  struct parallel *pool) {
    struct specular_job job = {.is_emitter = is_emitter, .materials = materials};
    size_t segments = input->surface.segments->count;
    specular_observer_init(&job.observer, input, parallel_thread_count(pool));
    job.evidence = mem_calloc(segments, sizeof *job.evidence);
    make_room(&job, segments);
    specular_points_find(&job.observer, is_emitter, job.points, pool);
    list_used(&job, segments);
    parallel_for(pool, job.used_count, find_misfits, &job);
    parallel_for(pool, segments, measure_segment, &job);
    parallel_for(pool, segments, fit_segment, &job);
    mem_free(job.used);
    mem_free(job.residual);
    mem_free(job.sample);
    mem_free(job.points);
    mem_free(job.evidence);
    specular_observer_release(&job.observer);
}
