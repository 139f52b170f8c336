/* emission_pattern.c -- see emission_pattern.h. */
#include "server/material/emission_pattern.h"

#include <math.h>

#include "common/mem.h"
#include "common/quantile.h"
#include "server/capture/top_k.h"
#include "server/material/denoise.h"
#include "server/scene/by_segment.h"
#include "server/scene/surface.h"
#include "server/state/evidence.h"

/* Least texels, and least measured share of them, for a pattern: 8 x 8 texels; what was not measured is filled in and,
 * of a picture, would be invented. */
#define MIN_TEXELS 64    /* +25 %: no change */
#define MIN_MEASURED 0.3 /* +25 %: no change */
/* Standard deviation over mean from which an emitter has a pattern. Evenly bright lamps and windows have .001 to .017
 * in six rooms, noise included. */
#define MIN_CONTRAST 0.1 /* +25 %: no change */
/* Part of an emitter's surface that may show less than its base colour reflects: outliers. */
#define DARK_OUTLIERS 0.02 /* +25 %: no change */
/* Deviation from the median, in the logarithm of radiance, at which an observation has half its weight. */
#define OUTLIER_SCALE 0.3f /* +25 %: no change */
/* Of a screen whose picture changes, observations further from the median than this are dropped. */
#define MAX_SCREEN_DEVIATION 0.7f /* +25 %: no change */
/* Added before a logarithm is taken; part of the segment's radiance; +25 %: no change. */
#define LOG_FLOOR 0.01f
#define CHUNK 64 /* texels a work item */

struct finder;

/* A segment that may have a pattern. */
struct emitter {
    const struct finder *finder;
    size_t segment, count;
    const uint32_t *texel; /* [count] of the finder's list */
    float scale;           /* measured = scale * radiance; at first 1 / mean of evidence.observed */
    bool is_measured;      /* enough of it was measured */
};

struct finder {
    struct emission_pattern_input in;
    struct materials *materials;       /* borrowed, both */
    struct emitter_evidence *evidence; /* [segment_count] */
    struct texels_by_segment texels;   /* owned, as all below */
    struct emitter *emitter;           /* [emitter_count] */
    size_t emitter_count;
    struct measurement *measured; /* [height][width] observed radiance, times the emitter's scale */
    struct color_prior *prior;    /* [chart_count] where has_emitter */
    bool *has_emitter;            /* [chart_count] charts of emitters that may have a pattern */
    struct texture denoised;      /* `measured`, denoised */
};

/* --- observations ---------------------------------------------------------------------------------- */

/* Inverse noise variance, for the mean radiance of the segment: with a place's own radiance bright places would
 * outweigh dark ones, whose relative noise is larger, wherever neighbours are averaged. */
static float weight_of(const struct emitter *e, const struct view *view, float mixing) {
    const struct finder *f = e->finder;
    return view->weight * noise_weight(f->in.noise, f->in.views, view, f->evidence[e->segment].observed, mixing);
}

static struct robust_sample observation_of(const struct emitter *e, const struct view *view, float mixing, rgb observed,
                                           bool sharp, rgb fused) {
    const struct finder *f = e->finder;
    rgb value = rgb_scale(observed, e->scale);
    float times_typical = rgb_mean(value);
    rgb noise = rgb_scale(noise_deviation(f->in.noise, f->in.views, view, fused), e->scale);
    return (struct robust_sample){.value = value,
                                  .gray = logf(fmaxf(rgb_mean(value), 0.0f) + LOG_FLOOR),
                                  .deviation = rgb_mean(noise) / (e->scale * rgb_mean(fused) + LOG_FLOOR),
                                  .weight = weight_of(e, view, mixing * times_typical * times_typical),
                                  .source = view->train,
                                  .sharp = view->weight,
                                  .noise = rgb_scale(noise, noise_draw(view, sharp)),
                                  .mixing = mixing * rgb_dot(value, value)};
}

/* Observations of a texel away from edges, those of the greatest weights. Saturated ones are lower bounds: the greatest
 * is used where there is no other observation, and only if it exceeds the segment's radiance; else the texel may be as
 * bright as the rest of the segment. */
static void observe_all(const struct emitter *e, uint32_t texel, struct measurement_observations *observations) {
    const struct surface *s = &e->finder->in.surface;
    const struct views *views = e->finder->in.views;
    rgb fused = fused_radiance(e->finder->in.fused, texel);
    struct robust_sample bound = {.weight = 0.0f};
    struct surface_point at;
    struct top_k best;
    struct top_k_item item[MEASUREMENT_OBSERVATIONS];
    observations->count = 0;
    if (!surface_at_texel(s->mesh, s->atlas, s->inverse, texel, &at))
        return;
    top_k_init(&best, item, MEASUREMENT_OBSERVATIONS);
    for (uint32_t t = 0; t < views->train_count; t++) {
        const struct photograph *photo = &views->scene->photograph[views->train[t]];
        struct view view;
        struct photograph_sample sample;
        if (!views_faces(views, t, at.position, at.normal, &view))
            continue;
        views_weigh(views, surface_texel_m2(s->mesh, s->atlas, at.triangle), &view);
        if (!top_k_takes(&best, weight_of(e, &view, 0.0f), t) ||
            views_edge(views, &view, at.triangle) >= VIEWS_EDGE - 1 ||
            !views_unoccluded(views, t, at.position, at.normal) || !photograph_sample(photo, view.x, view.y, &sample))
            continue;
        float mixing = views_mixing(views, &view, at.triangle, sample.radiance);
        bool saturated = photograph_sample_saturates(&sample);
        bool sharp = !saturated && photograph_sample_cubic(photo, view.x, view.y, &sample.radiance);
        struct robust_sample observation = observation_of(e, &view, mixing, sample.radiance, sharp, fused);
        size_t slot = saturated ? TOP_K_NONE : top_k_put(&best, observation.weight, t);
        if (slot != TOP_K_NONE)
            observations->observation[slot] = observation;
        else if (saturated && (bound.weight == 0.0f || observation.gray > bound.gray))
            bound = observation;
    }
    observations->count = best.count;
    if (observations->count == 0 && bound.weight > 0.0f && rgb_mean(bound.value) > 1.0f)
        observations->observation[observations->count++] = bound;
}

static void measure_texel(const struct emitter *e, uint32_t texel) {
    struct measurement_observations observations;
    observe_all(e, texel, &observations);
    /* Of a screen whose picture changed, keep the majority: the rest is another picture, not noise. */
    if (observations.count > 0 && e->finder->evidence[e->segment].changing_share > 0.0f)
        observations.count = robust_select(observations.observation, observations.count, MAX_SCREEN_DEVIATION);
    if (observations.count > 0)
        e->finder->measured[texel] = measurement_mean(&observations, OUTLIER_SCALE, rgb_gray(0.0f));
}

static void measure_chunk(void *user, size_t chunk, int thread) {
    (void)thread;
    const struct emitter *e = user;
    for (size_t i = chunk * CHUNK; i < (chunk + 1) * CHUNK && i < e->count; i++)
        measure_texel(e, e->texel[i]);
}

/* Scales the greatest value of an emitter to 1: denoise clamps to [0, 1]. */
static void fit_range(struct emitter *e) {
    struct measurement *measured = e->finder->measured;
    float greatest = 0.0f;
    for (size_t i = 0; i < e->count; i++)
        greatest = fmaxf(greatest, rgb_max(measurement_value(&measured[e->texel[i]])));
    float factor = greatest > 0.0f ? 1.0f / greatest : 1.0f;
    for (size_t i = 0; i < e->count; i++) {
        struct measurement *m = &measured[e->texel[i]];
        rgb_to_half(m->value, rgb_scale(measurement_value(m), factor));
        rgb_to_half(m->noise, rgb_scale(rgb_from_half(m->noise), factor));
        m->mixing = image_half_from_float(factor * factor * image_float_from_half(m->mixing));
    }
    e->scale *= factor;
}

/* Weighted mean and variance (summed over the channels) of an emitter's texels. */
struct moments {
    double sum[3], squares, weight;
};

static void moments_add(struct moments *s, double weight, rgb value) {
    s->sum[0] += weight * (double)value.r;
    s->sum[1] += weight * (double)value.g;
    s->sum[2] += weight * (double)value.b;
    s->squares += weight * (double)rgb_dot(value, value);
    s->weight += weight;
}

static rgb moments_mean(const struct moments *s) {
    double w = s->weight > 0.0 ? s->weight : 1.0;
    return rgb_make((float)(s->sum[0] / w), (float)(s->sum[1] / w), (float)(s->sum[2] / w));
}

static double moments_variance(const struct moments *s) {
    rgb mean = moments_mean(s);
    return s->weight > 0.0 ? fmax(s->squares / s->weight - (double)rgb_dot(mean, mean), 0.0) : 0.0;
}

/* Marks the charts of an emitter for denoising, if enough of it was measured. */
static void mark_charts(struct emitter *e) {
    const struct finder *f = e->finder;
    struct moments known = {.weight = 0.0};
    for (size_t i = 0; i < e->count; i++) {
        const struct measurement *m = &f->measured[e->texel[i]];
        if (m->weight > 0.0f)
            moments_add(&known, 1.0, measurement_value(m));
    }
    e->is_measured = known.weight >= MIN_MEASURED * (double)e->count;
    struct color_prior prior = {moments_mean(&known), (float)moments_variance(&known)};
    for (size_t i = 0; i < e->count && e->is_measured; i++) {
        uint32_t chart = surface_chart(&f->in.surface, e->texel[i]);
        f->has_emitter[chart] = true;
        f->prior[chart] = prior;
    }
}

/* --- patterns -------------------------------------------------------------------------------------- */

/* Surface area under a texel, m^2. */
static double texel_area(const struct surface *s, uint32_t texel) {
    uint32_t triangle = s->inverse->triangle[texel];
    const vec2 *c = s->atlas->corner[triangle];
    double charted = fabs((double)(c[1].x - c[0].x) * (double)(c[2].y - c[0].y) -
                          (double)(c[1].y - c[0].y) * (double)(c[2].x - c[0].x));
    return charted > 0.0 ? (double)vec3_length(mesh_cross(s->mesh, triangle)) / charted : 0.0;
}

static rgb denoised_at(const struct finder *f, uint32_t texel) {
    const float *c = f->denoised.texel[texel];
    return rgb_make(c[0], c[1], c[2]);
}

/* Sets an emitter's pattern, if its contrast is high enough. */
static void set_pattern(const struct emitter *e) {
    const struct finder *f = e->finder;
    struct materials *m = f->materials;
    struct moments moments = {.weight = 0.0};
    for (size_t i = 0; i < e->count; i++)
        moments_add(&moments, texel_area(&f->in.surface, e->texel[i]), denoised_at(f, e->texel[i]));
    rgb mean = moments_mean(&moments);
    if (!(sqrt(moments_variance(&moments)) > MIN_CONTRAST * sqrt((double)rgb_dot(mean, mean))))
        return;
    if (!m->emission_pattern)
        materials_start_emission_pattern(m);
    for (size_t i = 0; i < e->count; i++)
        materials_set_emission_pattern(m, e->texel[i], denoised_at(f, e->texel[i]), mean);
    evidence_set_radiance(&f->evidence[e->segment], rgb_scale(mean, 1.0f / e->scale));
}

/* --- the whole ------------------------------------------------------------------------------------- */

/* Lists the emitters that may have a pattern. */
static void finder_init(struct finder *f, const struct emission_pattern_input *in, struct materials *materials,
                        struct emitter_evidence *evidence) {
    const struct atlas *atlas = in->surface.atlas;
    size_t texels = (size_t)atlas->width * atlas->height, segments = in->surface.segments->count;
    *f = (struct finder){.in = *in, .materials = materials, .evidence = evidence};
    by_segment_sort(&f->texels, in->surface.segments, in->surface.inverse);
    f->emitter = mem_array(segments, sizeof *f->emitter);
    for (size_t s = 0; s < segments; s++) {
        const struct emitter_evidence *e = &evidence[s];
        size_t first = f->texels.first[s], count = f->texels.first[s + 1] - first;
        if (in->is_emitter[s] && !e->is_hidden && !e->is_unbounded && count >= MIN_TEXELS &&
            rgb_mean(e->observed) > 0.0f)
            f->emitter[f->emitter_count++] = (struct emitter){.finder = f,
                                                              .segment = s,
                                                              .count = count,
                                                              .texel = f->texels.texel + first,
                                                              .scale = 1.0f / rgb_mean(e->observed)};
    }
    /* Only few charts are written; untouched pages take no memory. */
    f->measured = mem_calloc(texels, sizeof *f->measured);
    f->denoised = (struct texture){atlas->width, atlas->height, mem_calloc(texels, sizeof *f->denoised.texel)};
    f->prior = mem_calloc(atlas->chart_count, sizeof *f->prior);
    f->has_emitter = mem_calloc(atlas->chart_count, sizeof *f->has_emitter);
}

static void finder_release(struct finder *f) {
    mem_free(f->has_emitter);
    mem_free(f->prior);
    texture_release(&f->denoised);
    mem_free(f->measured);
    mem_free(f->emitter);
    by_segment_release(&f->texels);
}

void emission_pattern_find(const struct emission_pattern_input *in, struct materials *materials,
                           struct emitter_evidence *evidence) {
    const struct surface *surface = &in->surface;
    struct finder f;
    materials_drop_emission_pattern(materials);
    finder_init(&f, in, materials, evidence);
    for (size_t i = 0; i < f.emitter_count; i++) {
        struct emitter *e = &f.emitter[i];
        parallel_for(in->pool, (e->count + CHUNK - 1) / CHUNK, measure_chunk, e);
        fit_range(e);
        mark_charts(e);
    }
    denoise(surface->atlas, surface->inverse, surface->mesh->triangle_count, f.measured, f.prior, f.has_emitter,
            &f.denoised, 1, NULL, in->pool);
    for (size_t i = 0; i < f.emitter_count; i++) {
        if (f.emitter[i].is_measured)
            set_pattern(&f.emitter[i]);
    }
    finder_release(&f);
}

/* --- emitted light --------------------------------------------------------------------------------- */

/* Greatest base colour (same in all channels) whose reflected light does not exceed a texel's radiance. */
static float max_base_color(const struct materials *m, const struct emitter_evidence *e, uint32_t texel) {
    rgb observed = rgb_mul(rgb_from_half(m->emission_pattern[texel]), e->radiance);
    const float value[3] = {observed.r, observed.g, observed.b};
    const float arrived[3] = {e->lambert.r, e->lambert.g, e->lambert.b};
    float most = INFINITY;
    for (int c = 0; c < 3; c++)
        most = arrived[c] > 0.0f ? fminf(most, value[c] / arrived[c]) : most;
    return most;
}

/* DARK_OUTLIERS quantile of max_base_color; INFINITY where there is no pattern. */
static float max_segment_base_color(const struct materials *m, const struct emitter_evidence *e, const uint32_t *texel,
                                    size_t count) {
    if (!m->emission_pattern || count == 0 || rgb_is_black(rgb_from_half(m->emission_pattern[texel[0]])))
        return INFINITY;
    float *most = mem_array(count, sizeof *most);
    for (size_t i = 0; i < count; i++)
        most[i] = max_base_color(m, e, texel[i]);
    float darkest = quantile(most, count, DARK_OUTLIERS);
    mem_free(most);
    return darkest;
}

/* Turns the pattern of outgoing radiance (mean `observed`) into that of emitted radiance (mean `own`). */
static void subtract_reflected(struct materials *m, uint32_t texel, rgb observed, rgb own) {
    rgb all = rgb_mul(rgb_from_half(m->emission_pattern[texel]), observed);
    materials_set_emission_pattern(m, texel, rgb_sub(all, rgb_sub(observed, own)), own);
}

void emission_pattern_separate(const struct emission_pattern_input *in, struct materials *materials,
                               const struct emitter_evidence *evidence, struct emitter_fit *own) {
    struct texels_by_segment texels;
    by_segment_sort(&texels, in->surface.segments, in->surface.inverse);
    for (size_t s = 0; s < in->surface.segments->count; s++) {
        const struct emitter_evidence *e = &evidence[s];
        const uint32_t *texel = texels.texel + texels.first[s];
        size_t count = texels.first[s + 1] - texels.first[s];
        own[s] = (struct emitter_fit){{0.0f, 0.0f, 0.0f}, NEUTRAL_BASE_COLOR};
        if (!in->is_emitter[s])
            continue;
        float darkest = max_segment_base_color(materials, e, texel, count);
        own[s].base_color = fminf(NEUTRAL_BASE_COLOR, darkest);
        rgb observed = rgb_mad(e->radiance, e->is_hidden ? 0.0f : -own[s].base_color, e->lambert);
        own[s].radiance = rgb_make(fmaxf(observed.r, 0.0f), fmaxf(observed.g, 0.0f), fmaxf(observed.b, 0.0f));
        for (size_t i = 0; i < count && darkest < INFINITY; i++)
            subtract_reflected(materials, texel[i], e->radiance, own[s].radiance);
    }
    by_segment_release(&texels);
}

void emission_pattern_restore(const struct emission_pattern_input *in, struct materials *materials,
                              struct emitter_evidence *evidence) {
    struct emitter_fit *own = mem_array(in->surface.segments->count, sizeof *own);
    emission_pattern_find(in, materials, evidence);
    emission_pattern_separate(in, materials, evidence, own);
    mem_free(own);
}
