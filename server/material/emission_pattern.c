/* emission_pattern.c -- see emission_pattern.h. */
#include "server/material/emission_pattern.h"

#include <math.h>

#include "common/mem.h"
#include "common/quantile.h"
#include "server/capture/best.h"
#include "server/material/denoise.h"
#include "server/scene/by_segment.h"
#include "server/scene/surface.h"
#include "server/state/evidence.h"

/* An emitter of fewer texels, or of which less was measured, has no pattern that could be told. */
#define LEAST_TEXELS 64
#define LEAST_MEASURED 0.3
/* Deviation over the mean from which on an emitter has a pattern. Lamps and windows that are equally bright all over come
 * to .001 to .017 in six rooms, noise and all; the eye sees no less in a picture that is smooth. */
#define LEAST_CONTRAST 0.1
/* The part of an emitter's surface that may show less than it is thought to reflect. */
#define DARKEST_PART 0.02
/* Looks differ by this much in their logarithm before one counts half. */
#define OUTLIER_SCALE 0.3f
#define SAME_PICTURE 0.7f /* and no more, of what most looks at a changing screen show */
#define LOG_FLOOR 0.01f /* of what the segment shows, where a logarithm is taken */
#define CHUNK 64 /* texels a work item */

struct finder;

/* A segment that may have a pattern. */
struct emitter {
    const struct finder *finder;
    size_t segment, count;
    const uint32_t *texel; /* [count] of the finder's list */
    float scale;           /* measured = scale * radiance; first that makes what it is known to show 1 in the mean */
    bool is_asked;         /* enough of it was measured */
};

struct finder {
    struct reconstruction *r;
    const struct views *views;
    struct texels_by_segment texels; /* owned, as all below */
    struct emitter *emitter;         /* [emitter_count] */
    size_t emitter_count;
    struct measured *measured;       /* [height][width] what photographs show, by the emitter's scale */
    struct color_prior *prior;       /* [chart_count] of what is asked, as the next */
    bool *is_asked;                  /* [chart_count] */
    struct texture found;            /* the measured without noise */
};

/* --- what is shown --------------------------------------------------------------------------------- */

/* By the noise of what the segment shows in the mean: by its own a bright place would outweigh dark ones beside
 * it, of which a larger share is noise, wherever neighbours are averaged. */
static float weight_of(const struct emitter *e, const struct view *view, float mixing) {
    const struct finder *f = e->finder;
    return view->weight * noise_weight(&f->r->noise, f->views, view, f->r->evidence[e->segment].least, mixing);
}

static struct robust_sample look_of(const struct emitter *e, const struct view *view, float mixing, rgb shown,
                                    bool sharp, rgb fused) {
    const struct finder *f = e->finder;
    rgb value = rgb_scale(shown, e->scale);
    float times_typical = rgb_mean(value);
    rgb noise = rgb_scale(noise_deviation(&f->r->noise, f->views, view, fused), e->scale);
    return (struct robust_sample){
        .value = value,
        .gray = logf(fmaxf(rgb_mean(value), 0.0f) + LOG_FLOOR),
        .deviation = rgb_mean(noise) / (e->scale * rgb_mean(fused) + LOG_FLOOR),
        .weight = weight_of(e, view, mixing * times_typical * times_typical),
        .source = view->train,
        .sharp = view->weight,
        .noise = rgb_scale(noise, noise_draw(view, sharp)),
        .mixing = mixing * rgb_dot(value, value)};
}

/* What the photographs show of a texel, clear of all edges; the best of them where there are many. Saturated, they tell how bright it is at least: the greatest
 * of that is taken where nothing else is told, unless it is less than the segment is known to show: then it may be as
 * bright as the rest of it. */
static void look_all(const struct emitter *e, uint32_t texel, struct measured_looks *looks) {
    const struct reconstruction *r = e->finder->r;
    const struct views *views = e->finder->views;
    rgb fused = fused_radiance(&r->fused, texel);
    struct robust_sample bound = {.weight = 0.0f};
    struct surface_point at;
    struct best best;
    struct best_item item[MEASURED_LOOKS];
    looks->count = 0;
    if (!surface_at_texel(&r->scene->mesh, &r->atlas, &r->inverse, texel, &at))
        return;
    best_init(&best, item, MEASURED_LOOKS);
    for (uint32_t t = 0; t < views->train_count; t++) {
        const struct photograph *photo = &r->scene->photograph[views->train[t]];
        struct view view;
        struct photograph_sample s;
        if (!views_faces(views, t, at.position, at.normal, &view) ||
            !best_takes(&best, weight_of(e, &view, 0.0f), t) ||
            views_edge(views, &view, at.triangle) >= VIEWS_EDGE - 1 ||
            !views_unoccluded(views, t, at.position, at.normal) || !photograph_sample(photo, view.x, view.y, &s))
            continue;
        float mixing = views_mixing(views, &view, at.triangle, s.radiance);
        bool saturated = s.saturated[0] || s.saturated[1] || s.saturated[2];
        bool sharp = !saturated && photograph_sample_cubic(photo, view.x, view.y, &s.radiance);
        struct robust_sample look = look_of(e, &view, mixing, s.radiance, sharp, fused);
        size_t slot = saturated ? BEST_NONE : best_put(&best, look.weight, t);
        if (slot != BEST_NONE)
            looks->look[slot] = look;
        else if (saturated && (bound.weight == 0.0f || look.gray > bound.gray))
            bound = look;
    }
    looks->count = best.count;
    if (looks->count == 0 && bound.weight > 0.0f && rgb_mean(bound.value) > 1.0f)
        looks->look[looks->count++] = bound;
}

static void measure_texel(const struct emitter *e, uint32_t texel) {
    struct measured_looks looks;
    look_all(e, texel, &looks);
    /* Of a screen whose picture changed what most looks show: what the others do is no noise of it. */
    if (looks.count > 0 && e->finder->r->evidence[e->segment].changes > 0.0f)
        looks.count = robust_keep(looks.look, looks.count, SAME_PICTURE);
    if (looks.count > 0)
        e->finder->measured[texel] = measured_mean(&looks, OUTLIER_SCALE, rgb_gray(0.0f));
}

static void measure_chunk(void *user, size_t chunk, int thread) {
    (void)thread;
    const struct emitter *e = user;
    for (size_t i = chunk * CHUNK; i < (chunk + 1) * CHUNK && i < e->count; i++)
        measure_texel(e, e->texel[i]);
}

/* Makes the greatest value of an emitter 1, which is what denoise keeps. */
static void fit_range(struct emitter *e) {
    struct measured *measured = e->finder->measured;
    float greatest = 0.0f;
    for (size_t i = 0; i < e->count; i++)
        greatest = fmaxf(greatest, rgb_max(measured_value(&measured[e->texel[i]])));
    float factor = greatest > 0.0f ? 1.0f / greatest : 1.0f;
    for (size_t i = 0; i < e->count; i++) {
        struct measured *m = &measured[e->texel[i]];
        rgb_to_half(m->value, rgb_scale(measured_value(m), factor));
        rgb_to_half(m->noise, rgb_scale(rgb_from_half(m->noise), factor));
        m->mixing = image_half_from_float(factor * factor * image_float_from_half(m->mixing));
    }
    e->scale *= factor;
}

/* What texels of an emitter have in the mean, by weight, and how far they are from it, all channels together. */
struct spread {
    double sum[3], squares, weight;
};

static void spread_add(struct spread *s, double weight, rgb value) {
    s->sum[0] += weight * (double)value.r;
    s->sum[1] += weight * (double)value.g;
    s->sum[2] += weight * (double)value.b;
    s->squares += weight * (double)rgb_dot(value, value);
    s->weight += weight;
}

static rgb spread_mean(const struct spread *s) {
    double w = s->weight > 0.0 ? s->weight : 1.0;
    return rgb_make((float)(s->sum[0] / w), (float)(s->sum[1] / w), (float)(s->sum[2] / w));
}

static double spread_variance(const struct spread *s) {
    rgb mean = spread_mean(s);
    return s->weight > 0.0 ? fmax(s->squares / s->weight - (double)rgb_dot(mean, mean), 0.0) : 0.0;
}

/* Has the charts of an emitter asked, if enough of it was measured. */
static void ask(struct emitter *e) {
    const struct finder *f = e->finder;
    struct spread known = {.weight = 0.0};
    for (size_t i = 0; i < e->count; i++) {
        const struct measured *m = &f->measured[e->texel[i]];
        if (m->weight > 0.0f)
            spread_add(&known, 1.0, measured_value(m));
    }
    e->is_asked = known.weight >= LEAST_MEASURED * (double)e->count;
    struct color_prior prior = {spread_mean(&known), (float)spread_variance(&known)};
    for (size_t i = 0; i < e->count && e->is_asked; i++) {
        uint32_t chart = f->r->atlas.chart_of_triangle[f->r->inverse.triangle[e->texel[i]]];
        f->is_asked[chart] = true;
        f->prior[chart] = prior;
    }
}

/* --- patterns -------------------------------------------------------------------------------------- */

/* Area of surface under a texel, in units that are the same all over the texture. */
static double texel_area(const struct reconstruction *r, uint32_t texel) {
    uint32_t triangle = r->inverse.triangle[texel];
    const vec2 *c = r->atlas.corner[triangle];
    double charted = fabs((double)(c[1].x - c[0].x) * (double)(c[2].y - c[0].y) -
                          (double)(c[1].y - c[0].y) * (double)(c[2].x - c[0].x));
    return charted > 0.0 ? (double)vec3_length(mesh_cross(&r->scene->mesh, triangle)) / charted : 0.0;
}

static rgb found_at(const struct finder *f, uint32_t texel) {
    const float *c = f->found.texel[texel];
    return rgb_make(c[0], c[1], c[2]);
}

/* Gives an emitter the pattern that was found, if it is not equally bright all over. */
static void keep(const struct emitter *e) {
    const struct finder *f = e->finder;
    struct materials *m = &f->r->materials;
    struct spread spread = {.weight = 0.0};
    for (size_t i = 0; i < e->count; i++)
        spread_add(&spread, texel_area(f->r, e->texel[i]), found_at(f, e->texel[i]));
    rgb mean = spread_mean(&spread);
    if (!(sqrt(spread_variance(&spread)) > LEAST_CONTRAST * sqrt((double)rgb_dot(mean, mean))))
        return;
    if (!m->emission_pattern)
        materials_start_emission_pattern(m);
    for (size_t i = 0; i < e->count; i++)
        materials_set_emission_pattern(m, e->texel[i], found_at(f, e->texel[i]), mean);
    f->r->evidence[e->segment].shown = rgb_scale(mean, 1.0f / e->scale);
}

/* --- the whole ------------------------------------------------------------------------------------- */

/* Lists the emitters that photographs tell enough of. */
static void finder_init(struct finder *f, struct reconstruction *r, const struct views *views) {
    size_t texels = (size_t)r->atlas.width * r->atlas.height;
    *f = (struct finder){.r = r, .views = views};
    by_segment_sort(&f->texels, &r->segments, &r->inverse);
    f->emitter = mem_array(r->segments.count, sizeof *f->emitter);
    for (size_t s = 0; s < r->segments.count; s++) {
        const struct emitter_evidence *e = &r->evidence[s];
        size_t first = f->texels.first[s], count = f->texels.first[s + 1] - first;
        if (r->is_emitter[s] && !e->hidden && !e->unbound && count >= LEAST_TEXELS && rgb_mean(e->least) > 0.0f)
            f->emitter[f->emitter_count++] = (struct emitter){
                .finder = f, .segment = s, .count = count, .texel = f->texels.texel + first,
                .scale = 1.0f / rgb_mean(e->least)};
    }
    /* Of few charts: pages that are not written take no memory. */
    f->measured = mem_calloc(texels, sizeof *f->measured);
    f->found = (struct texture){r->atlas.width, r->atlas.height, mem_calloc(texels, sizeof *f->found.texel)};
    f->prior = mem_calloc(r->atlas.chart_count, sizeof *f->prior);
    f->is_asked = mem_calloc(r->atlas.chart_count, sizeof *f->is_asked);
}

static void finder_release(struct finder *f) {
    mem_free(f->is_asked);
    mem_free(f->prior);
    texture_release(&f->found);
    mem_free(f->measured);
    mem_free(f->emitter);
    by_segment_release(&f->texels);
}

void emission_pattern_find(struct reconstruction *r, const struct views *views) {
    struct finder f;
    materials_drop_emission_pattern(&r->materials);
    finder_init(&f, r, views);
    for (size_t i = 0; i < f.emitter_count; i++) {
        struct emitter *e = &f.emitter[i];
        parallel_for(r->pool, (e->count + CHUNK - 1) / CHUNK, measure_chunk, e);
        fit_range(e);
        ask(e);
    }
    denoise(&r->atlas, &r->inverse, r->scene->mesh.triangle_count, f.measured, f.prior, f.is_asked, &f.found, r->pool);
    for (size_t i = 0; i < f.emitter_count; i++) {
        if (f.emitter[i].is_asked)
            keep(&f.emitter[i]);
    }
    finder_release(&f);
}

/* --- their own light ------------------------------------------------------------------------------- */

/* The least base colour, of all channels, with which a texel would show no more than it does. */
static float most_reflected(const struct materials *m, const struct emitter_evidence *e, uint32_t texel) {
    rgb shown = rgb_mul(rgb_from_half(m->emission_pattern[texel]), e->shown);
    const float value[3] = {shown.r, shown.g, shown.b}, arrived[3] = {e->arrived.r, e->arrived.g, e->arrived.b};
    float most = INFINITY;
    for (int c = 0; c < 3; c++)
        most = arrived[c] > 0.0f ? fminf(most, value[c] / arrived[c]) : most;
    return most;
}

/* What nearly all of the texels could reflect; INFINITY where there is no pattern. */
static float darkest_reflected(const struct materials *m, const struct emitter_evidence *e, const uint32_t *texel,
                               size_t count) {
    if (!m->emission_pattern || count == 0 || rgb_is_black(rgb_from_half(m->emission_pattern[texel[0]])))
        return INFINITY;
    float *most = mem_array(count, sizeof *most);
    for (size_t i = 0; i < count; i++)
        most[i] = most_reflected(m, e, texel[i]);
    float darkest = quantile(most, count, DARKEST_PART);
    mem_free(most);
    return darkest;
}

/* Makes the pattern of all that a texel shows, in the mean `shown`, that of its own light, in the mean `own`. */
static void take_out(struct materials *m, uint32_t texel, rgb shown, rgb own) {
    rgb all = rgb_mul(rgb_from_half(m->emission_pattern[texel]), shown);
    materials_set_emission_pattern(m, texel, rgb_sub(all, rgb_sub(shown, own)), own);
}

void emission_pattern_own(struct reconstruction *r, struct emission_own *own) {
    struct materials *m = &r->materials;
    struct texels_by_segment texels;
    by_segment_sort(&texels, &r->segments, &r->inverse);
    for (size_t s = 0; s < r->segments.count; s++) {
        const struct emitter_evidence *e = &r->evidence[s];
        const uint32_t *texel = texels.texel + texels.first[s];
        size_t count = texels.first[s + 1] - texels.first[s];
        own[s] = (struct emission_own){{0.0f, 0.0f, 0.0f}, NEUTRAL_BASE_COLOR};
        if (!r->is_emitter[s])
            continue;
        float darkest = darkest_reflected(m, e, texel, count);
        own[s].base_color = fminf(NEUTRAL_BASE_COLOR, darkest);
        rgb shown = rgb_mad(e->shown, e->hidden ? 0.0f : -own[s].base_color, e->arrived);
        own[s].radiance = rgb_make(fmaxf(shown.r, 0.0f), fmaxf(shown.g, 0.0f), fmaxf(shown.b, 0.0f));
        for (size_t i = 0; i < count && darkest < INFINITY; i++)
            take_out(m, texel[i], e->shown, own[s].radiance);
    }
    by_segment_release(&texels);
}

void emission_pattern_restore(struct reconstruction *r, const struct views *views) {
    struct emission_own *own = mem_array(r->segments.count, sizeof *own);
    emission_pattern_find(r, views);
    emission_pattern_own(r, own);
    mem_free(own);
}
