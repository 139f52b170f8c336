/* changing_light.c -- see changing_light.h. */
#include "server/light/changing_light.h"

#include <math.h>

#include "common/rng.h"
#include "common/spaced.h"
#include "server/capture/top_k.h"
#include "server/gather/highlight.h"
#include "server/render/sampler.h"
#include "server/scene/surface.h"

#define PLACES 96 /* texels that are asked; a quarter of them at least by enough photographs */
/* Standard deviation of the logarithm of what photographs show, from which on it is worth asking. */
#define SPREAD_LEAST 0.8f
#define SHARE_LEAST 0.1f /* of the places; where fewer spread so far none is asked */
/* Of what white paint would show: black is less, lit is more. */
#define BLACK 0.25f
#define LIT 0.6f
/* A photograph tells of black where it could show what is lit, and its noise is less than this part of black. */
#define NOISE_MOST 0.25f
/* All around a place must be black or lit as well: poses are off by pixels, and edges of paint are not to be taken for
 * changes. Within a picture it is darker here and there. */
#define RING_PIXELS 6.0f
#define RING_LIT 0.35f
#define MIN_OBSERVATIONS 2 /* of either kind */
/* So many of either kind together; and of the lit ones, twice as many as are needed, are tested for highlights. */
#define BOTH_KINDS (2 * MIN_OBSERVATIONS)
/* The glossiest surface that is no metal; what is lit must be so many times brighter than its highlight. */
#define SPECULAR 1.0f
#define BRIGHTER 2.0f
#define KEY_CHANGING 0x71e3u /* keeps these random numbers apart from others of the texel */
#define SAMPLES 64           /* directions of a highlight; and half as many of lights */

enum light_kind { TELLS_NOTHING, TELLS_BLACK, TELLS_LIT };

/* Classifies a photograph's observation of a place whose Lambert radiance at albedo 1 is `white`. */
static enum light_kind kind_of(const struct divide *d, const struct view *view, uint32_t triangle, float white,
                               float *shown) {
    const struct photograph *photo = &d->views->scene->photograph[d->views->train[view->train]];
    struct photograph_sample s;
    if (views_edge(d->views, view, triangle) > 0 || !photograph_sample(photo, view->x, view->y, &s))
        return TELLS_NOTHING;
    struct photograph_ring ring = photograph_ring(photo, view->x, view->y, RING_PIXELS);
    *shown = rgb_mean(s.radiance);
    if (*shown > LIT * white && ring.darkest > RING_LIT * white)
        return TELLS_LIT;
    float noise = rgb_mean(noise_deviation(d->noise, d->views, view, rgb_gray(BLACK * white)));
    bool is_black = *shown < BLACK * white && ring.brightest < BLACK * white &&
                    rgb_mean(s.clip_radiance) > LIT * white && noise < NOISE_MOST * BLACK * white;
    return is_black ? TELLS_BLACK : TELLS_NOTHING;
}

/* Whether a highlight could show there about what a photograph does. */
static bool may_be_highlight(const struct divide *d, const struct surface_point *at, uint32_t texel, uint32_t train,
                             float shown, int thread) {
    static const struct highlight_levels levels = {3, 1, {0.1f, 0.3f, 0.6f}, {SPECULAR}};
    struct highlight highlight;
    float brightest = 0.0f;
    vec3 wo = views_direction(d->views, train, at->position);
    highlight_gather(&highlight, &d->scratch[thread], d->field, at, wo, &levels,
                     sampler_key(KEY_CHANGING, texel, train), SAMPLES, SAMPLES / 2);
    for (size_t i = 0; i < levels.roughness_count; i++)
        brightest = fmaxf(brightest, rgb_mean(highlight.radiance[i][0]));
    return shown < BRIGHTER * brightest;
}

/* Random observations among the lit ones: consecutive frames of a film share a viewpoint, and its highlight. */
static float drawn_weight(uint32_t texel, uint32_t train) {
    return 1.0f - rng_to_float((uint32_t)rng_key(KEY_CHANGING, texel, train));
}

/* Whether some photographs show the texel black, and others lit and not by a highlight. */
static bool changed(const struct divide *d, uint32_t texel, int thread) {
    const struct surface *s = &d->surface;
    struct surface_point at;
    rgb white;
    struct {
        uint32_t train;
        float shown;
    } lit[BOTH_KINDS];
    struct top_k drawn;
    struct top_k_item item[BOTH_KINDS];
    size_t black_count = 0, own = 0;
    top_k_init(&drawn, item, BOTH_KINDS);
    if (!surface_at_texel(s->mesh, s->atlas, s->inverse, texel, &at) || !divide_lambert(d, texel, &white))
        return false;
    for (uint32_t t = 0; t < d->views->train_count; t++) {
        struct view view;
        float shown = 0.0f;
        enum light_kind kind = views_sees(d->views, t, at.position, at.normal, &view)
                                   ? kind_of(d, &view, at.triangle, rgb_mean(white), &shown)
                                   : TELLS_NOTHING;
        black_count += kind == TELLS_BLACK;
        size_t slot = kind == TELLS_LIT ? top_k_put(&drawn, drawn_weight(texel, t), t) : TOP_K_NONE;
        if (slot != TOP_K_NONE)
            lit[slot].train = t, lit[slot].shown = shown;
    }
    if (black_count < MIN_OBSERVATIONS)
        return false;
    for (size_t i = 0; i < drawn.count; i++)
        own += !may_be_highlight(d, &at, texel, lit[i].train, lit[i].shown, thread);
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
        spread += fused->spread[at] > SPREAD_LEAST;
        place[places++] = at;
    }
    if (places < PLACES / 4 || (float)spread < SHARE_LEAST * (float)places)
        return 0.0f;
    for (size_t i = 0; i < places; i++)
        changes += fused->spread[place[i]] > SPREAD_LEAST && changed(d, place[i], thread);
    return (float)changes / (float)places;
}
