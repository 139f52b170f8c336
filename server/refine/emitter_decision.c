/* emitter_decision.c -- see emitter_decision.h. */
#include "server/refine/emitter_decision.h"

#include <math.h>

#include "server/scene/by_segment.h"

/* Least part of a segment's radiance that base colour 1 could not reflect. Specular reflection and noise stay below it
 * on all but mirrors; a lamp is missed whose emission is less than half of the light that falls on it. */
#define EMITTER_SHARE 0.4f /* +25 %: no change */
/* Texels of a lower base colour are left out: the ratio that gives incident light is too noisy. */
#define DARKEST_BASE_COLOR 0.02f /* +25 %: no change */
/* Iteration number of the decision's random numbers, which the optimiser never reaches. */
#define DECISION_ITERATION UINT64_C(0x7fff0000)

struct decision_job {
    const struct emitter_decision_input *in;
    const struct materials *materials;
    struct emitter_evidence *evidence;
    struct texels_by_segment texels;
};

/* Sums reflected radiance and base colour over observations of a segment: their ratio is the radiance that a surface of
 * base colour 1 would reflect. */
static void gather_light(void *user, size_t segment, int thread) {
    struct decision_job *job = user;
    const struct materials *m = job->materials;
    struct observation_batch *b = &job->in->batch[thread];
    size_t count = by_segment_count(&job->texels, segment);
    size_t wanted = count < EMITTER_DECISION_TEXELS ? count : EMITTER_DECISION_TEXELS;
    observation_batch_clear(b);
    for (size_t i = 0; i < wanted; i++)
        observation_add(b, by_segment_spaced(&job->texels, segment, i, wanted), DECISION_ITERATION);
    observation_trace(b);
    const rgb *own = &m->emission[segment];
    double reflected[3] = {0}, base[3] = {0};
    for (size_t k = 0; k < b->observation_count; k++) {
        const float *texel = m->base_color.texel[b->observation[k].texel];
        if (texel[0] + texel[1] + texel[2] < 3.0f * DARKEST_BASE_COLOR)
            continue;
        for (int s = 0; s < b->samples; s++) {
            const rgb *radiance = &b->radiance[k * (size_t)b->samples + (size_t)s];
            reflected[0] += (double)(radiance->r - own->r);
            reflected[1] += (double)(radiance->g - own->g);
            reflected[2] += (double)(radiance->b - own->b);
            for (int c = 0; c < 3; c++)
                base[c] += (double)texel[c];
        }
    }
    struct emitter_evidence *e = &job->evidence[segment];
    rgb lambert = e->radiance; /* without observations a segment counts as a reflector */
    if (base[0] > 0.0 && base[1] > 0.0 && base[2] > 0.0)
        lambert = rgb_make((float)fmax(reflected[0] / base[0], 0.0), (float)fmax(reflected[1] / base[1], 0.0),
                           (float)fmax(reflected[2] / base[2], 0.0));
    evidence_set_lambert(e, lambert);
}

void emitter_decision_make(const struct emitter_decision_input *in, struct emitter_evidence *evidence, bool *is_emitter,
                           struct materials *materials) {
    struct decision_job job = {.in = in, .materials = materials, .evidence = evidence};
    size_t segments = in->surface.segments->count;
    by_segment_sort(&job.texels, in->surface.segments, in->surface.inverse);
    parallel_for(in->pool, segments, gather_light, &job);
    by_segment_release(&job.texels);
    for (size_t s = 0; s < segments; s++) {
        struct emitter_evidence *e = &evidence[s];
        is_emitter[s] = settings_emitter(in->settings, (uint32_t)s, e->is_hidden || e->emitted_share >= EMITTER_SHARE);
        rgb own = rgb_sub(e->radiance, rgb_scale(e->lambert, NEUTRAL_BASE_COLOR));
        materials->emission[s] =
            is_emitter[s] ? rgb_make(fmaxf(own.r, 0.0f), fmaxf(own.g, 0.0f), fmaxf(own.b, 0.0f)) : rgb_gray(0.0f);
    }
}
