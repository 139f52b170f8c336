/* reflection.c -- see reflection.h. */
#include "server/light/decision/reflection.h"

#include "common/mem.h"
#include "common/quantile.h"
#include "server/gather/highlight.h"
#include "server/light/decision/bright_texels.h"
#include "server/light/decision/edge_light.h"
#include "server/light/decision/sky_doubt.h"
#include "server/material/specular_posterior.h"
#include "server/render/sampler.h"
#include "server/scene/surface.h"

#define PLACES 32 /* texels of a segment, and photographs of each, of which the median is taken */
#define VIEWS 4
#define LOBES (SPECULAR_CANDIDATES - 1)
/* Directions of a highlight, by each level of roughness, and towards lights. */
#define SAMPLES_A_LEVEL 8
#define LIGHT_SAMPLES 32
#define KEY_REFLECTION 0x3ef1u /* keeps these random numbers apart from others of the texel */

/* What highlights add to albedo, by lobe and observation. */
struct feigned {
    float albedo[LOBES][PLACES * VIEWS];
    size_t count;
};

/* Probability that a normal deviate is at least z. */
static double tail(double z) { return 0.5 * erfc(z * 0.70710678118654752); }

/* Probability that a surface of this albedo reflects so much of `lambert`. */
static double reflects(rgb radiance, rgb lambert, double albedo, double deviation) {
    double white = fmax((double)rgb_mean(lambert), 1e-30);
    return tail(log(fmax((double)rgb_mean(radiance), 1e-30) / (albedo * white)) / deviation);
}

double reflection_probability(const struct emitter_evidence *e, double albedo, double deviation) {
    if (!e->is_unbounded)
        return reflects(e->radiance, e->lambert, albedo, deviation);
    return fmin(reflects(e->observed, e->lambert, albedo, deviation),
                reflects(e->radiance, e->lambert, albedo, hypot(deviation, (double)e->deviation)));
}

static void add_view(const struct divide *d, const struct surface_point *at, uint32_t texel, uint32_t train,
                     float lambert, int thread, struct feigned *f) {
    struct highlight highlight;
    vec3 wo = views_direction(d->views, train, at->position);
    highlight_gather(&highlight, &d->scratch[thread], d->field, at, wo, &specular_levels,
                     sampler_key(KEY_REFLECTION, texel, train), SAMPLES_A_LEVEL * HIGHLIGHT_ROUGHNESSES, LIGHT_SAMPLES);
    for (size_t k = 0; k < HIGHLIGHT_ROUGHNESSES; k++)
        for (size_t m = 0; m < HIGHLIGHT_SPECULARS; m++)
            f->albedo[specular_candidate(k, m) - 1][f->count] = rgb_mean(highlight.radiance[k][m]) / lambert;
    f->count++;
}

static void add_place(const struct divide *d, uint32_t texel, int thread, struct feigned *f) {
    const struct surface *s = &d->surface;
    struct surface_point at;
    struct view view[VIEWS];
    rgb lambert;
    if (!surface_at_texel(s->mesh, s->atlas, s->inverse, texel, &at) || !divide_lambert(d, texel, &lambert) ||
        !(rgb_mean(lambert) > 0.0f))
        return;
    size_t seen = views_pick(d->views, at.position, at.normal, texel, VIEWS, view);
    for (size_t i = 0; i < seen; i++)
        add_view(d, &at, texel, view[i].train, rgb_mean(lambert), thread, f);
}

/* Fills *f with the highlights of the brighter of texel[count]. */
static void find_highlights(const struct reconstruction *r, const struct divide *d, const uint32_t *texel, size_t count,
                            int thread, struct feigned *f) {
    uint32_t chosen[PLACES];
    size_t chosen_count = bright_texels_choose(r, texel, count, PLACES, chosen);
    f->count = 0;
    for (size_t i = 0; i < chosen_count; i++)
        add_place(d, chosen[i], thread, f);
}

void reflection_find(struct reconstruction *r, const struct divide *d, uint32_t segment, const uint32_t *texel,
                     size_t count, int thread) {
    struct emitter_evidence *e = &r->evidence[segment];
    double prior[SPECULAR_CANDIDATES];
    e->sky_lambert = 0.0f;
    e->reflection = 1.0f;
    if (!(rgb_mean(e->radiance) > reflection_limit(0.0f) * rgb_mean(e->lambert)))
        return;
    e->sky_lambert = sky_doubt(r, texel, count);
    double deviation = reflection_light_deviation((double)rgb_mean(e->lambert), (double)e->sky_lambert,
                                                  r->sky_is_fitted ? FIT_DEVIATION : FILL_DEVIATION,
                                                  (double)(DARK_DEVIATION * d->views->median_radiance));
    e->reflection = (float)reflection_probability(e, ALBEDO_WHITE, deviation);
    if (!reflection_is_unlikely(e))
        return;
    double around = (double)edge_light(r, d, texel, count, thread);
    struct feigned *f = mem_alloc(sizeof *f);
    find_highlights(r, d, texel, count, thread, f);
    specular_prior((double)count / (double)r->inverse.valid_count, prior);
    double sum = prior[SPECULAR_DIFFUSE] * reflection_probability(e, around * ALBEDO_WHITE, deviation);
    for (size_t c = 0; c < LOBES; c++) {
        double feigned = (double)quantile(f->albedo[c], f->count, 0.5);
        sum += prior[c + 1] * reflection_probability(e, around * (ALBEDO_WHITE + feigned), deviation);
    }
    e->reflection = (float)sum;
    mem_free(f);
}

bool reflection_is_unlikely(const struct emitter_evidence *evidence) {
    return (double)evidence->reflection < tail((double)REFLECTION_DEVIATIONS);
}
