/* changing_light.c -- see changing_light.h. */
#include "server/light/decision/changing_light.h"

#include <math.h>

#include "common/rng.h"
#include "common/spaced.h"
#include "server/capture/top_k.h"
#include "server/gather/highlight.h"
#include "server/render/sampler.h"
#include "server/scene/surface.h"

#define PLACES 96 /* texels of a segment that are tested; a quarter of them at least with enough observations */
/* Least standard deviation of the logarithm of a texel's observations: with less it is not tested, for time. */
#define MIN_SPREAD 0.8f
#define MIN_SHARE 0.1f /* of the places; where fewer spread so far none is tested */
/* Radiance over the Lambert radiance at albedo 1: of a dark observation less, of a bright one more. */
#define DARK 0.25f
#define BRIGHT 0.6f
/* A photograph observes darkness if its range includes BRIGHT and its noise is below this part of DARK. */
#define MAX_NOISE 0.25f
/* All pixels on a circle about a place must be dark or bright as well: poses are off by pixels, and edges of paint are
 * not to be taken for changes. Within a picture some are darker. */
#define RING_PIXELS 6.0f
#define RING_BRIGHT 0.35f
#define MIN_OBSERVATIONS 2 /* of either kind */
/* So many of either kind together; and as many of the bright ones, twice what is needed, are tested for highlights. */
#define BOTH_KINDS (2 * MIN_OBSERVATIONS)
/* Specular of the glossiest dielectric; a bright observation must be so many times brighter than its highlight. */
#define SPECULAR 1.0f
#define OVER_HIGHLIGHT 2.0f
#define KEY_CHANGING 0x71e3u /* keeps these random numbers apart from others of the texel */
#define SAMPLES 64           /* directions of a highlight; and half as many of lights */

enum observed_kind { OBSERVED_NEITHER, OBSERVED_DARK, OBSERVED_BRIGHT };

/* Classifies a photograph's observation of a place whose Lambert radiance at albedo 1 is `lambert`. */
static enum observed_kind kind_of(const struct divide *d, const struct view *view, uint32_t triangle, float lambert,
                                  float *observed) {
    const struct photograph *photo = &d->views->scene->photograph[d->views->train[view->train]];
    struct photograph_sample s;
    if (views_edge(d->views, view, triangle) > 0 || !photograph_sample(photo, view->x, view->y, &s))
        return OBSERVED_NEITHER;
    struct photograph_ring ring = photograph_ring(photo, view->x, view->y, RING_PIXELS);
    *observed = rgb_mean(s.radiance);
    if (*observed > BRIGHT * lambert && ring.darkest > RING_BRIGHT * lambert)
        return OBSERVED_BRIGHT;
    float noise = rgb_mean(noise_deviation(d->noise, d->views, view, rgb_gray(DARK * lambert)));
    bool is_dark = *observed < DARK * lambert && ring.brightest < DARK * lambert &&
                   rgb_mean(s.clip_radiance) > BRIGHT * lambert && noise < MAX_NOISE * DARK * lambert;
    return is_dark ? OBSERVED_DARK : OBSERVED_NEITHER;
}

/* Whether a highlight could be about as bright there as a photograph's observation. */
static bool may_be_highlight(const struct divide *d, const struct surface_point *at, uint32_t texel, uint32_t train,
                             float observed, int thread) {
    static const struct highlight_levels levels = {3, 1, {0.1f, 0.3f, 0.6f}, {SPECULAR}};
    struct highlight highlight;
    float brightest = 0.0f;
    vec3 wo = views_direction(d->views, train, at->position);
    highlight_gather(&highlight, &d->scratch[thread], d->field, at, wo, &levels,
                     sampler_key(KEY_CHANGING, texel, train), SAMPLES, SAMPLES / 2);
    for (size_t i = 0; i < levels.roughness_count; i++)
        brightest = fmaxf(brightest, rgb_mean(highlight.radiance[i][0]));
    return observed < OVER_HIGHLIGHT * brightest;
}

/* Random observations among the bright ones: consecutive frames of a film share a viewpoint, and its highlight. */
static float drawn_weight(uint32_t texel, uint32_t train) {
    return 1.0f - rng_to_float((uint32_t)rng_key(KEY_CHANGING, texel, train));
}

/* Whether the texel is dark in some photographs, and in others bright and not by a highlight. */
static bool changed(const struct divide *d, uint32_t texel, int thread) {
    const struct surface *s = &d->surface;
    struct surface_point at;
    rgb lambert;
    struct {
        uint32_t train;
        float observed;
    } bright[BOTH_KINDS];
    struct top_k drawn;
    struct top_k_item item[BOTH_KINDS];
    size_t dark_count = 0, own = 0;
    top_k_init(&drawn, item, BOTH_KINDS);
    if (!surface_at_texel(s->mesh, s->atlas, s->inverse, texel, &at) || !divide_lambert(d, texel, &lambert))
        return false;
    for (uint32_t t = 0; t < d->views->train_count; t++) {
        struct view view;
        float observed = 0.0f;
        enum observed_kind kind = views_sees(d->views, t, at.position, at.normal, &view)
                                      ? kind_of(d, &view, at.triangle, rgb_mean(lambert), &observed)
                                      : OBSERVED_NEITHER;
        dark_count += kind == OBSERVED_DARK;
        size_t slot = kind == OBSERVED_BRIGHT ? top_k_put(&drawn, drawn_weight(texel, t), t) : TOP_K_NONE;
        if (slot != TOP_K_NONE)
            bright[slot].train = t, bright[slot].observed = observed;
    }
    if (dark_count < MIN_OBSERVATIONS)
        return false;
    for (size_t i = 0; i < drawn.count; i++)
        own += !may_be_highlight(d, &at, texel, bright[i].train, bright[i].observed, thread);
    return own >= MIN_OBSERVATIONS;
}

float changing_light(const struct divide *d, const uint32_t *texel, size_t count, int thread) {
    const struct fused *fused = d->fused;
    uint32_t place[PLACES];
    size_t places = 0, spread = 0, changes = 0;
    for (size_t i = 0; i < PLACES && count >= PLACES; i++) {
        uint32_t at = texel[spaced(i, count, PLACES)];
        if (fused->count[at] < (float)BOTH_KINDS)
            continue;
        spread += fused->spread[at] > MIN_SPREAD;
        place[places++] = at;
    }
    if (places < PLACES / 4 || (float)spread < MIN_SHARE * (float)places)
        return 0.0f;
    for (size_t i = 0; i < places; i++)
        changes += fused->spread[place[i]] > MIN_SPREAD && changed(d, place[i], thread);
    return (float)changes / (float)places;
}
