/* emitters.c -- see emitters.h. */
#include "server/reconstruct/emitters.h"

#include <math.h>

#include "common/mem.h"
#include "common/quantile.h"
#include "server/reconstruct/by_segment.h"
#include "server/scene/surface.h"

#define TEXELS_PER_SEGMENT 256
#define VIEWS_PER_TEXEL 4
/* Looks that a class of distance from an edge must have for its median to count. */
#define LEAST_LOOKS 12
/* Of a segment seen in mixed pixels alone, fewer than this are an accident of noise. */
#define LEAST_LOOKS_MIXED 3
#define RING_PIXELS 4.0f
#define OUTSHINES 1.3f
/* A saturated pixel must be so much brighter than all around it: a bar before a white sky is as white as the sky. */
#define OUTSHINES_WHITE 1.05f
/* Part of the looks at a segment which must be the surface's own. Lamps in a row outshine each other in many. */
#define OWN_PART 0.25f
/* Part of the shown radiance that must be beyond reflection. Specular reflection and noise stay
 * below it on all but mirrors; a lamp whose own light is less than half of what falls on it is
 * missed. */
#define EMITTER_SHARE 0.4f
/* A base colour below this tells too little of the light that fell on it. */
#define DARKEST_BASE_COLOR 0.02f
/* Segments this many times brighter than the median of the room outshine it. */
#define BRIGHT 4.0f
/* Iteration number that keeps the decision's random numbers apart from the optimiser's. */
#define DECISION_ITERATION UINT64_C(0x7fff0000)

/* The i-th of `wanted` evenly spaced texels of a segment. */
static uint32_t spaced_texel(const struct texels_by_segment *t, size_t segment, size_t i, size_t wanted) {
    size_t count = t->first[segment + 1] - t->first[segment];
    return t->texel[t->first[segment] + i * count / wanted];
}

static size_t texel_count(const struct texels_by_segment *t, size_t segment, size_t most) {
    size_t count = t->first[segment + 1] - t->first[segment];
    return count < most ? count : most;
}

struct evidence_job {
    struct reconstruction *r;
    const struct views *views;
    struct texels_by_segment texels;
    struct look_batch *batch; /* [threads] */
    struct emitter_evidence *evidence;
};

/* Values of one channel; of the saturated ones, the lower bounds. */
struct channel_values {
    struct bounded value[TEXELS_PER_SEGMENT * VIEWS_PER_TEXEL];
    size_t count;
};

/* What the looks of one class of distance from an edge (views_edge) show. */
struct shown_values {
    struct channel_values channel[3];
    size_t outshone_count; /* looks left out since something beside was as bright */
};

static void add_value(struct channel_values *v, float radiance, bool saturated) {
    v->value[v->count++] = (struct bounded){radiance, saturated};
}

/* Whether what a look of this class of distance from an edge shows is the surface's own. A bright
 * window may stand behind a thin frame: a pixel that mixes surfaces speaks only when it is clearly
 * brighter than all around it, one near an edge when it is no darker than its surroundings. */
static bool outshines(const struct photograph *photo, const struct view *view, const struct photograph_sample *sample,
                      int edge) {
    float own = rgb_mean(sample->radiance);
    if (edge == 0)
        return true;
    struct photograph_ring ring = photograph_ring(photo, view->x, view->y, RING_PIXELS);
    if (edge == VIEWS_EDGE)
        return own > OUTSHINES * ring.brightest;
    bool is_white = sample->saturated[0] || sample->saturated[1] || sample->saturated[2];
    return own * ring.count >= (is_white ? OUTSHINES_WHITE : 1.0f) * ring.sum;
}

static void observe_texel(const struct evidence_job *job, uint32_t texel, struct shown_values *shown) {
    const struct reconstruction *r = job->r;
    struct surface_point at;
    struct view view[VIEWS_PER_TEXEL];
    if (!surface_at_texel(&r->scene->mesh, &r->atlas, &r->inverse, texel, &at))
        return;
    size_t seen = views_pick(job->views, at.position, at.normal, texel, VIEWS_PER_TEXEL, view);
    for (size_t k = 0; k < seen; k++) {
        struct photograph_sample sample;
        const struct photograph *photo = &r->scene->photograph[job->views->train[view[k].train]];
        int edge = views_edge(job->views, &view[k], at.triangle);
        if (!photograph_sample(photo, view[k].x, view[k].y, &sample))
            continue;
        if (!outshines(photo, &view[k], &sample, edge)) {
            shown[edge].outshone_count++;
            continue;
        }
        struct channel_values *channel = shown[edge].channel;
        add_value(&channel[0], sample.radiance.r, sample.saturated[0]);
        add_value(&channel[1], sample.radiance.g, sample.saturated[1]);
        add_value(&channel[2], sample.radiance.b, sample.saturated[2]);
    }
}

static void observe_segment(void *user, size_t segment, int thread) {
    (void)thread;
    struct evidence_job *job = user;
    if (job->evidence[segment].hidden)
        return; /* it is known from elsewhere */
    struct shown_values *shown = mem_calloc(VIEWS_EDGE + 1, sizeof *shown);
    size_t wanted = texel_count(&job->texels, segment, TEXELS_PER_SEGMENT);
    for (size_t i = 0; i < wanted; i++)
        observe_texel(job, spaced_texel(&job->texels, segment, i, wanted), shown);
    /* The looks farthest from edges, as soon as there are some. */
    struct shown_values *best = shown;
    for (int edge = 1; edge <= VIEWS_EDGE; edge++) {
        if (best->channel[0].count < LEAST_LOOKS)
            best = &shown[edge];
    }
    size_t told = best->channel[0].count;
    size_t least = best == &shown[VIEWS_EDGE] ? LEAST_LOOKS_MIXED : 1;
    bool is_own = told >= least && (float)told >= OWN_PART * (float)(told + best->outshone_count);
    if (!is_own)
        best = &shown[0]; /* most often it is not what shines: nothing is known */
    struct emitter_evidence *e = &job->evidence[segment];
    e->seen = is_own;
    e->mixed = best == &shown[VIEWS_EDGE];
    float value[3] = {0};
    for (int c = 0; c < 3; c++)
        e->bound[c] = best->channel[c].count > 0 &&
                      !quantile_bounded_median(best->channel[c].value, best->channel[c].count, &value[c]);
    e->least = rgb_make(value[0], value[1], value[2]);
    if (!e->unbound)
        e->shown = e->least;
    mem_free(shown);
}

void emitters_observe(const struct reconstruction *r, const struct views *views,
                      struct emitter_evidence *evidence) {
    struct evidence_job job = {.r = (struct reconstruction *)r, .views = views, .evidence = evidence};
    by_segment_sort(&job.texels, &r->segments, &r->inverse);
    parallel_for(r->pool, r->segments.count, observe_segment, &job);
    by_segment_release(&job.texels);
}

void emitters_light_bright(struct reconstruction *r, const struct views *views,
                           const struct emitter_evidence *evidence) {
    for (size_t i = 0; i < r->segments.count; i++) {
        rgb shown = evidence[i].shown;
        bool shines = evidence[i].hidden || evidence[i].unbound || rgb_mean(shown) > BRIGHT * views->median_radiance;
        r->materials.emission[i] = shines ? shown : rgb_gray(0.0f);
    }
    world_update_lights(&r->world);
}

/* Base colours of a segment that were looked at and the radiance reflected there, added up: their
 * ratio is what a white surface would reflect. */
static void gather_light(void *user, size_t segment, int thread) {
    struct evidence_job *job = user;
    struct reconstruction *r = job->r;
    struct look_batch *b = &job->batch[thread];
    size_t wanted = texel_count(&job->texels, segment, EMITTERS_TEXELS);
    look_batch_clear(b);
    for (size_t i = 0; i < wanted; i++)
        look_add(b, spaced_texel(&job->texels, segment, i, wanted), DECISION_ITERATION);
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

void emitters_decide(struct reconstruction *r, const struct views *views, struct look_batch *batch,
                     struct emitter_evidence *evidence) {
    struct evidence_job job = {.r = r, .views = views, .batch = batch, .evidence = evidence};
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
