/* emitters.c -- see emitters.h. */
#include "server/light/emitters.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "common/quantile.h"
#include "server/scene/by_segment.h"
#include "server/scene/surface.h"

/* Texels of a segment, and photographs of each, of which the median is taken. */
#define TEXELS_PER_SEGMENT 256
#define VIEWS_PER_TEXEL 4
/* Observations that an edge class must have for its median to be used. */
#define MIN_OBSERVATIONS 12
/* The same for a segment observed only in mixed pixels; fewer may be noise. */
#define MIN_OBSERVATIONS_MIXED 3
/* Surroundings that an observation near an edge is compared with: pixels on this circle. */
#define RING_PIXELS 4.0f
/* An observation of a mixed pixel counts if it is so many times brighter than all around it. */
#define OUTSHINES 1.3f
/* A saturated pixel must be so much brighter than all around it: a bar before a white sky is as white as the sky. */
#define OUTSHINES_SATURATED 1.05f
/* Within a pixel of an edge it does not count either where it lies between others that saturate, in so many directions:
 * the light may be theirs, as at a bar before a white sky. Along a tube one direction does. */
#define BETWEEN_PAIRS 2
#define BLEEDS (VIEWS_EDGE - 1)
/* Least part of a segment's observations that are not outshone by their surroundings. Lamps in a row outshine each
 * other in many. */
#define MIN_OWN_PART 0.25f
/* Standard errors by which the mean of the observations must be below their median. */
#define SURELY_LESS 2.0f
/* Segments this many times brighter than the median of the room outshine it. */
#define BRIGHT 4.0f

struct evidence_job {
    struct reconstruction *r;
    const struct views *views;
    struct texels_by_segment texels;
    struct emitter_evidence *evidence;
};

/* Values of one channel; of the saturated ones, the lower bounds. */
struct channel_values {
    struct bounded value[TEXELS_PER_SEGMENT * VIEWS_PER_TEXEL];
    size_t count;
};

/* Sums over unsaturated observations, and over fused radiance at their texels. */
struct ratio_sums {
    double radiance[3];                                 /* observed, by channel */
    double own, fused, own_own, own_fused, fused_fused; /* of the channels' means, and of products of these */
    size_t count;
};

/* Observations of one class of distance from an edge (views_edge). */
struct edge_class {
    struct channel_values channel[3];
    struct ratio_sums sums;
    size_t outshone_count; /* observations left out since something beside was as bright */
    /* Those that tell whose light it is: unsaturated ones that were left out; of those that are in these, and the
     * ones that saturate before darker surroundings. */
    size_t telling_outshone_count, telling_count;
};

static void add_value(struct channel_values *v, float radiance, bool saturated) {
    v->value[v->count++] = (struct bounded){radiance, saturated};
}

static void add_to_sums(const struct reconstruction *r, uint32_t texel, const struct photograph_sample *s,
                        struct ratio_sums *sums) {
    double fused =
        r->fused.radiance && !r->fused.is_bound[texel] ? (double)rgb_mean(fused_radiance(&r->fused, texel)) : 0.0;
    double own = (double)rgb_mean(s->radiance);
    if (!(fused > 0.0) || photograph_sample_saturates(s))
        return;
    sums->own += own;
    sums->fused += fused;
    sums->own_own += own * own;
    sums->own_fused += own * fused;
    sums->fused_fused += fused * fused;
    for (int c = 0; c < 3; c++)
        sums->radiance[c] += (double)(&s->radiance.r)[c];
    sums->count++;
}

/* Whether the mean of the observations is surely below fused radiance, their median: something that the mesh lacks,
 * such as the bars of a window, stands before the surface in some. The standard error is that of a ratio of sums
 * (Cochran 1977, eq. 6.13). */
static bool is_obstructed(const struct ratio_sums *sums) {
    if (sums->count < MIN_OBSERVATIONS)
        return false;
    double n = (double)sums->count, ratio = sums->own / sums->fused;
    double squares = sums->own_own - 2.0 * ratio * sums->own_fused + ratio * ratio * sums->fused_fused;
    double error = sqrt(fmax(squares, 0.0) * n / (n - 1.0)) / sums->fused;
    return ratio + (double)SURELY_LESS * error < 1.0;
}

/* The mean of the observations, which is what the room gets of a lamp; not more than their median. */
static rgb mean_radiance(const struct ratio_sums *sums, rgb median) {
    float mean[3];
    for (int c = 0; c < 3; c++)
        mean[c] = fminf((float)(sums->radiance[c] / (double)sums->count), (&median.r)[c]);
    return rgb_make(mean[0], mean[1], mean[2]);
}

/* Whether an observation of this edge class shows the surface itself. A bright window may be behind a thin frame: a
 * mixed pixel counts only if it is clearly brighter than all around it, one near an edge if it is no darker. */
static bool outshines(const struct photograph *photo, const struct view *view, const struct photograph_sample *sample,
                      int edge) {
    float own = rgb_mean(sample->radiance);
    if (edge == 0)
        return true;
    struct photograph_ring ring = photograph_ring(photo, view->x, view->y, RING_PIXELS);
    if (edge == VIEWS_EDGE)
        return own > OUTSHINES * ring.brightest;
    bool is_saturated = photograph_sample_saturates(sample);
    if (is_saturated && edge >= BLEEDS && ring.saturated_pairs >= BETWEEN_PAIRS)
        return false;
    return own * ring.count >= (is_saturated ? OUTSHINES_SATURATED : 1.0f) * ring.sum;
}

/* Whether an observation tells that its light is the surface's own: it does not saturate, or what is around it is
 * darker. */
static bool tells(const struct photograph *photo, const struct view *view, const struct photograph_sample *sample) {
    struct photograph_ring ring = photograph_ring(photo, view->x, view->y, RING_PIXELS);
    return !photograph_sample_saturates(sample) ||
           rgb_mean(sample->radiance) * ring.count >= OUTSHINES_SATURATED * ring.sum;
}

static void observe_texel(const struct evidence_job *job, uint32_t texel, struct edge_class *class) {
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
            class[edge].outshone_count++;
            class[edge].telling_outshone_count += !photograph_sample_saturates(&sample);
            continue;
        }
        class[edge].telling_count += edge > 0 || tells(photo, &view[k], &sample);
        add_to_sums(r, texel, &sample, &class[edge].sums);
        struct channel_values *channel = class[edge].channel;
        add_value(&channel[0], sample.radiance.r, sample.saturated[0]);
        add_value(&channel[1], sample.radiance.g, sample.saturated[1]);
        add_value(&channel[2], sample.radiance.b, sample.saturated[2]);
    }
}

static size_t outshone_count(const struct edge_class *class) {
    size_t count = 0;
    for (int edge = 0; edge <= VIEWS_EDGE; edge++)
        count += class[edge].outshone_count;
    return count;
}

/* Adds the observations of a class to another. */
static void add_class(struct edge_class *to, const struct edge_class *from) {
    for (int c = 0; c < 3; c++) {
        struct channel_values *into = &to->channel[c];
        memcpy(&into->value[into->count], from->channel[c].value,
               from->channel[c].count * sizeof *from->channel[c].value);
        into->count += from->channel[c].count;
    }
    to->outshone_count += from->outshone_count;
}

/* Whether no class but that of mixed pixels has enough observations, but all of these together do. */
static bool is_scattered(const struct edge_class *class) {
    size_t most = 0, all = 0;
    for (int edge = 0; edge < VIEWS_EDGE; edge++) {
        most = most > class[edge].channel[0].count ? most : class[edge].channel[0].count;
        all += class[edge].channel[0].count;
    }
    return most < MIN_OBSERVATIONS && all >= MIN_OBSERVATIONS;
}

/* The class farthest from edges that has enough observations. Those of a small lamp may be scattered over classes: then
 * they are taken together, as class 1. */
static struct edge_class *choose_class(struct edge_class *class) {
    struct edge_class *best = class;
    if (is_scattered(class)) {
        for (int edge = 0; edge < VIEWS_EDGE; edge++)
            if (edge != 1)
                add_class(&class[1], &class[edge]);
    }
    for (int edge = 1; edge <= VIEWS_EDGE && best->channel[0].count < MIN_OBSERVATIONS; edge++)
        best = &class[edge];
    return best;
}

static bool is_own(size_t own, size_t outshone) { return (float)own >= MIN_OWN_PART * (float)(own + outshone); }

/* Whether photographs that saturate are outvoted by others, which do not, and in which something beside is brighter: a
 * bar before a white sky. Mixed pixels, which are outshone by their own surface, do not vote. */
static bool is_outvoted(const struct edge_class *class) {
    size_t own = 0, outshone = 0;
    for (int edge = 0; edge < VIEWS_EDGE; edge++) {
        own += class[edge].telling_count;
        outshone += class[edge].telling_outshone_count;
    }
    return outshone >= MIN_OBSERVATIONS && !is_own(own, outshone);
}

/* Medians of a class. */
static void take_medians(struct emitter_evidence *e, struct edge_class *class) {
    float value[3] = {0};
    for (int c = 0; c < 3; c++)
        e->saturated[c] = class->channel[c].count > 0 &&
                          !quantile_bounded_median(class->channel[c].value, class->channel[c].count, &value[c]);
    e->observed = rgb_make(value[0], value[1], value[2]);
}

static void fill_evidence(struct emitter_evidence *e, struct edge_class *class) {
    size_t outshone = outshone_count(class);
    struct edge_class *best = choose_class(class);
    size_t least = best == &class[VIEWS_EDGE] ? MIN_OBSERVATIONS_MIXED : 1;
    e->is_seen = best->channel[0].count >= least && is_own(best->channel[0].count, best->outshone_count);
    e->is_outshone = !e->is_seen && outshone >= MIN_OBSERVATIONS;
    if (!e->is_seen)
        best = class; /* mostly outshone: no value */
    e->only_mixed = best == &class[VIEWS_EDGE];
    take_medians(e, best);
    if (evidence_saturates(e) && is_outvoted(class)) {
        e->is_seen = false;
        e->is_outshone = true;
        e->observed = rgb_gray(0.0f);
    }
    if (e->is_unbounded)
        return;
    /* Near edges dark observations are left out as outshone: only those away from them have an unbiased mean. */
    bool obstructed = best == class && e->is_seen && !evidence_saturates(e) && is_obstructed(&class->sums);
    evidence_set_radiance(e, obstructed ? mean_radiance(&class->sums, e->observed) : e->observed);
}

static void observe_segment(void *user, size_t segment, int thread) {
    (void)thread;
    struct evidence_job *job = user;
    if (job->evidence[segment].is_hidden)
        return; /* its radiance is estimated, not observed */
    struct edge_class *class = mem_calloc(VIEWS_EDGE + 1, sizeof *class);
    size_t count = by_segment_count(&job->texels, segment);
    size_t wanted = count < TEXELS_PER_SEGMENT ? count : TEXELS_PER_SEGMENT;
    for (size_t i = 0; i < wanted; i++)
        observe_texel(job, by_segment_spaced(&job->texels, segment, i, wanted), class);
    fill_evidence(&job->evidence[segment], class);
    mem_free(class);
}

void emitters_observe(const struct reconstruction *r, const struct views *views, struct emitter_evidence *evidence) {
    struct evidence_job job = {.r = (struct reconstruction *)r, .views = views, .evidence = evidence};
    by_segment_sort(&job.texels, &r->segments, &r->inverse);
    parallel_for(r->pool, r->segments.count, observe_segment, &job);
    by_segment_release(&job.texels);
}

bool emitters_outshine(float radiance, float median_radiance) { return radiance > BRIGHT * median_radiance; }

void emitters_light_bright(struct reconstruction *r, const struct views *views,
                           const struct emitter_evidence *evidence) {
    for (size_t i = 0; i < r->segments.count; i++) {
        rgb radiance = evidence[i].radiance;
        bool emits = evidence[i].is_hidden || evidence[i].is_unbounded ||
                     (!evidence[i].is_sunlit && emitters_outshine(rgb_mean(radiance), views->median_radiance));
        r->materials.emission[i] = emits ? radiance : rgb_gray(0.0f);
    }
    world_update_lights(&r->world);
}
