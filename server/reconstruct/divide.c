/* divide.c -- see divide.h. */
#include "server/reconstruct/divide.h"

#include <math.h>

#include "common/image.h"
#include "common/mem.h"
#include "server/reconstruct/highlight.h"
#include "server/reconstruct/robust.h"
#include "server/render/sampler.h"
#include "server/scene/surface.h"

#define CHUNK 256 /* texels a work item */
#define MAX_LOOKS 48
/* Directions for one highlight. Each texel sees several photographs, and its neighbours as many. */
#define SAMPLES 16
#define LIGHT_SAMPLES 8
#define KEY_DIVIDE 5 /* keeps these random numbers apart from others of the texel */
/* Base colours differ by this much in their logarithm before one counts half; dark ones by this
 * much in themselves. */
#define OUTLIER_SCALE 0.3f
#define OUTLIER_FLOOR 0.03f
/* A look has half its weight where this part of it is highlight. */
#define HIGHLIGHT_PART 0.2f
/* Less white light than this share of the median radiance tells nothing of base colour. */
#define DARKEST 1e-4f
#define NEUTRAL_BASE_COLOR 0.5f

/* What is gathered of one texel. */
struct texel_looks {
    size_t count;
    struct robust_sample look[MAX_LOOKS];
};

static uint32_t segment_of(const struct reconstruction *r, uint32_t texel) {
    return r->segments.of_triangle[r->inverse.triangle[texel]];
}

static bool light_at(const struct divide *d, uint32_t texel, struct surface_point *at,
                     struct irradiance *light) {
    const struct reconstruction *r = d->r;
    struct probe_mix mix;
    if (!surface_at_texel(&r->scene->mesh, &r->atlas, &r->inverse, texel, at))
        return false;
    probes_mix(d->probes, &r->atlas, &r->fused, texel, at, &mix);
    probes_irradiance(d->probes, &mix, light);
    return true;
}

bool divide_white(const struct divide *d, uint32_t texel, rgb *white) {
    struct surface_point at;
    struct irradiance light;
    if (!light_at(d, texel, &at, &light))
        return false;
    *white = irradiance_diffuse(&light, at.shading, 1.0f, at.shading);
    return true;
}

static rgb divide_channels(rgb over, rgb under, float least) {
    return rgb_make(over.r / fmaxf(under.r, least), over.g / fmaxf(under.g, least),
                    over.b / fmaxf(under.b, least));
}

static void add_look(const struct divide *d, uint32_t texel, const struct surface_point *at,
                     const struct irradiance *light, const struct view *view, rgb shown,
                     struct incident *scratch, struct texel_looks *looks) {
    const struct materials *m = &d->r->materials;
    uint32_t segment = segment_of(d->r, texel);
    float median = d->views->median_radiance;
    float weight = view->weight * views_trust(d->views, view, at->triangle);
    vec3 wo = views_direction(d->views, view->train, at->position);
    rgb white = irradiance_diffuse(light, at->shading, m->roughness[segment], wo);
    rgb gloss = rgb_gray(0.0f);
    if (m->specular[segment] > 0.0f) {
        struct highlight highlight;
        struct highlight_levels level = {1, 1, {m->roughness[segment]}, {m->specular[segment]}};
        highlight_gather(&highlight, scratch, d->field, at, wo, &level,
                         sampler_key(KEY_DIVIDE, texel, view->train), SAMPLES, LIGHT_SAMPLES);
        gloss = highlight.radiance[0][0];
        float part = rgb_mean(gloss) / fmaxf(rgb_mean(shown), 0.01f * median) * (1.0f / HIGHLIGHT_PART);
        weight /= 1.0f + part * part;
    }
    rgb base = divide_channels(rgb_sub(shown, gloss), white, DARKEST * median);
    looks->look[looks->count++] =
        (struct robust_sample){base, logf(fmaxf(rgb_mean(base), 0.0f) + OUTLIER_FLOOR), weight};
}

static void look_all(const struct divide *d, uint32_t texel, struct incident *scratch,
                     struct texel_looks *looks) {
    struct surface_point at;
    struct irradiance light;
    looks->count = 0;
    if (!light_at(d, texel, &at, &light))
        return;
    for (uint32_t t = 0; t < d->views->train_count && looks->count < MAX_LOOKS; t++) {
        struct view view;
        struct photograph_sample s;
        if (views_sees(d->views, t, at.position, at.normal, &view) &&
            photograph_sample(&d->r->scene->photograph[d->views->train[t]], view.x, view.y, &s) &&
            !s.saturated[0] && !s.saturated[1] && !s.saturated[2])
            add_look(d, texel, &at, &light, &view, s.radiance, scratch, looks);
    }
}

static void set_half(uint16_t half[3], rgb value) {
    half[0] = image_half_from_float(value.r);
    half[1] = image_half_from_float(value.g);
    half[2] = image_half_from_float(value.b);
}

static void set_texel(struct reconstruction *r, uint32_t texel, rgb value) {
    float *to = r->materials.base_color.texel[texel];
    to[0] = clampf(value.r, 0.0f, 1.0f);
    to[1] = clampf(value.g, 0.0f, 1.0f);
    to[2] = clampf(value.b, 0.0f, 1.0f);
}

static void divide_texel(struct divide *d, uint32_t texel, struct incident *scratch) {
    struct texel_looks looks;
    look_all(d, texel, scratch, &looks);
    d->known[texel] = looks.count > 0;
    if (d->r->is_emitter[segment_of(d->r, texel)])
        set_texel(d->r, texel, rgb_gray(NEUTRAL_BASE_COLOR));
    else if (looks.count > 0)
        set_texel(d->r, texel, robust_mean(looks.look, looks.count, OUTLIER_SCALE));
}

struct divide_range {
    struct divide *divide;
    size_t first, count;
};

static void divide_chunk(void *user, size_t chunk, int thread) {
    const struct divide_range *range = user;
    struct divide *d = range->divide;
    size_t begin = chunk * CHUNK, end = begin + CHUNK < range->count ? begin + CHUNK : range->count;
    for (size_t i = begin; i < end; i++)
        divide_texel(d, d->r->inverse.valid[range->first + i], &d->scratch[thread]);
}

void divide_texels(struct divide *d, size_t first, size_t count) {
    struct divide_range range = {d, first, count};
    parallel_for(d->r->pool, (count + CHUNK - 1) / CHUNK, divide_chunk, &range);
}

/* Mean base colour of each segment's known texels; neutral where there is none. */
static rgb *segment_means(const struct divide *d) {
    const struct reconstruction *r = d->r;
    double(*sum)[4] = mem_calloc(r->segments.count, sizeof *sum);
    rgb *mean = mem_array(r->segments.count, sizeof *mean);
    for (size_t i = 0; i < r->inverse.valid_count; i++) {
        uint32_t texel = r->inverse.valid[i];
        double *to = sum[segment_of(r, texel)];
        for (int c = 0; c < 3 && d->known[texel]; c++)
            to[c] += (double)r->materials.base_color.texel[texel][c];
        to[3] += d->known[texel];
    }
    for (size_t s = 0; s < r->segments.count; s++)
        mean[s] = sum[s][3] > 0.0 ? rgb_make((float)(sum[s][0] / sum[s][3]), (float)(sum[s][1] / sum[s][3]),
                                             (float)(sum[s][2] / sum[s][3]))
                                  : rgb_gray(NEUTRAL_BASE_COLOR);
    mem_free(sum);
    return mean;
}

void divide_fill(struct divide *d, uint16_t (*radiance)[3]) {
    struct reconstruction *r = d->r;
    rgb *mean = segment_means(d);
    for (size_t i = 0; i < r->inverse.valid_count; i++) {
        uint32_t texel = r->inverse.valid[i];
        rgb white;
        if (d->known[texel] || !divide_white(d, texel, &white))
            continue;
        uint32_t segment = segment_of(r, texel);
        set_texel(r, texel, mean[segment]);
        set_half(radiance[texel], rgb_mul(mean[segment], white));
    }
    mem_free(mean);
}
