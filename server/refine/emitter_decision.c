/* emitter_decision.c -- see emitter_decision.h. */
#include "server/refine/emitter_decision.h"

#include <math.h>

#include "server/scene/by_segment.h"

/* Part of the shown radiance that must be beyond reflection. Specular reflection and noise stay
 * below it on all but mirrors; a lamp whose own light is less than half of what falls on it is
 * missed. */
#define EMITTER_SHARE 0.4f
/* A base colour below this tells too little of the light that fell on it. */
#define DARKEST_BASE_COLOR 0.02f
/* Iteration number that keeps the decision's random numbers apart from the optimiser's. */
#define DECISION_ITERATION UINT64_C(0x7fff0000)

struct decision_job {
    struct reconstruction *r;
    struct texels_by_segment texels;
    struct look_batch *batch; /* [threads] */
    struct emitter_evidence *evidence;
};

/* Base colours of a segment that were looked at and the radiance reflected there, added up: their
 * ratio is what a white surface would reflect. */
static void gather_light(void *user, size_t segment, int thread) {
    struct decision_job *job = user;
    struct reconstruction *r = job->r;
    struct look_batch *b = &job->batch[thread];
    size_t count = by_segment_count(&job->texels, segment);
    size_t wanted = count < EMITTER_DECISION_TEXELS ? count : EMITTER_DECISION_TEXELS;
    look_batch_clear(b);
    for (size_t i = 0; i < wanted; i++)
        look_add(b, by_segment_spaced(&job->texels, segment, i, wanted), DECISION_ITERATION);
    look_trace(b);
    const rgb *own = &r->materials.emission[segment];
    double reflected[3] = {0}, base[3] = {0};
    for (size_t k = 0; k < b->look_count; k++) {
        const float *texel = r->materials.base_color.texel[b->look[k].texel];
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
    e->arrived = e->shown; /* without evidence a segment reflects what it shows */
    if (!(base[0] > 0.0) || !(base[1] > 0.0) || !(base[2] > 0.0))
        return;
    e->arrived = rgb_make((float)fmax(reflected[0] / base[0], 0.0),
                          (float)fmax(reflected[1] / base[1], 0.0),
                          (float)fmax(reflected[2] / base[2], 0.0));
}

void emitter_decision_make(struct reconstruction *r, struct look_batch *batch, struct emitter_evidence *evidence) {
    struct decision_job job = {.r = r, .batch = batch, .evidence = evidence};
    by_segment_sort(&job.texels, &r->segments, &r->inverse);
    parallel_for(r->pool, r->segments.count, gather_light, &job);
    by_segment_release(&job.texels);
    for (size_t s = 0; s < r->segments.count; s++) {
        struct emitter_evidence *e = &evidence[s];
        float shown = rgb_mean(e->shown);
        e->share = shown > 0.0f ? clampf(1.0f - rgb_mean(e->arrived) / shown, 0.0f, 1.0f) : 0.0f;
        r->is_emitter[s] = e->hidden || e->share >= EMITTER_SHARE;
        rgb own = rgb_sub(e->shown, rgb_scale(e->arrived, NEUTRAL_BASE_COLOR));
        r->materials.emission[s] =
            r->is_emitter[s] ? rgb_make(fmaxf(own.r, 0.0f), fmaxf(own.g, 0.0f), fmaxf(own.b, 0.0f))
                             : rgb_gray(0.0f);
    }
}
