/* divide.c -- see divide.h. */
#include "server/material/divide.h"

#include <float.h>
#include <math.h>

#include "common/image.h"
#include "common/mem.h"
#include "server/capture/best.h"
#include "server/gather/highlight.h"
#include "server/material/color_prior.h"
#include "server/render/bsdf.h"
#include "server/render/sampler.h"
#include "server/scene/rgb_half.h"
#include "server/scene/surface.h"

#define CHUNK 256 /* texels a work item */
/* Directions for one highlight, at most and at least, and half as many samples of lights. Each texel sees several
 * photographs, and its neighbours as many; those that share a pixel need so many together. */
#define SAMPLES_MOST 16
#define SAMPLES_LEAST 4
#define SAMPLES_A_PIXEL 128.0
#define KEY_DIVIDE 5 /* keeps these random numbers apart from others of the texel */
/* Base colours differ by this much in their logarithm before one counts half; dark ones by this
 * much in themselves. */
#define OUTLIER_SCALE 0.3f
#define OUTLIER_FLOOR 0.03f
/* A look has half its weight where this part of it is highlight, if the base colour is what is typical of its segment;
 * no segment is taken for darker than this. */
#define HIGHLIGHT_PART 0.2f
#define DARKEST_TYPICAL 0.02f
/* Base colour by which looks are weighed. Were it a texel's own, bright texels would count for more than
 * dark ones wherever neighbours are averaged, and dark tiles between white joints turn grey. */
#define TYPICAL_BASE_COLOR 0.5f
/* Less white light than this share of the median radiance tells nothing of base colour. */
#define DARKEST 1e-4f
#define DARK 1e-3f /* as much less tells nothing of detail */
/* A base colour of which a look says more than this is not one. */
#define MOST 4.0f
/* Variance of base colour by light of others at which what photographs show of a texel counts as much as
 * what is to be expected there. */
#define MIXING_TOLD 0.01f

size_t divide_highlight_samples(double texels_a_pixel) {
    double samples = SAMPLES_A_PIXEL / fmax(texels_a_pixel, 1.0);
    return (size_t)fmin(fmax(samples, SAMPLES_LEAST), SAMPLES_MOST);
}

/* All but the sun's. */
static bool light_without_sun(const struct divide *d, uint32_t texel, struct surface_point *at,
                              struct irradiance *light) {
    const struct reconstruction *r = d->r;
    struct probe_mix mix;
    if (!surface_at_texel(&r->scene->mesh, &r->atlas, &r->inverse, texel, at))
        return false;
    probes_mix(d->probes, &r->atlas, &r->fused, texel, at, &mix);
    probes_irradiance(d->probes, &mix, light);
    return true;
}

static bool light_at(const struct divide *d, uint32_t texel, struct surface_point *at,
                     struct irradiance *light) {
    if (!light_without_sun(d, texel, at, light))
        return false;
    sun_add_light(&d->r->sun, d->r->world.accel, at, light);
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

/* Reads a photograph more sharply where all that this takes is of one surface; else `shown` stays. Tells
 * whether it did. */
static bool sharpen(const struct divide *d, const struct view *view, uint32_t triangle, rgb *shown) {
    return views_edge(d->views, view, triangle) < VIEWS_EDGE - 1 &&
           photograph_sample_cubic(&d->r->scene->photograph[d->views->train[view->train]], view->x, view->y, shown);
}

/* A look before its highlight is known. */
struct candidate {
    struct view view;
    rgb shown, white;
    float weight, mixing;
    bool sharp;
};

/* The best of a texel's photographs, by weight. */
struct candidates {
    struct best best;
    struct best_item item[MEASURED_LOOKS];
    struct candidate candidate[MEASURED_LOOKS];
};

/* Photograph `train` of the texel, unless it shows nothing of it or there are enough that weigh more. */
static void offer_look(const struct divide *d, uint32_t segment, const struct surface_point *at,
                       const struct irradiance *light, uint32_t train, struct candidates *of) {
    const struct photograph *photo = &d->r->scene->photograph[d->views->train[train]];
    struct candidate c;
    struct photograph_sample s;
    if (!views_faces(d->views, train, at->position, at->normal, &c.view))
        return;
    c.white = irradiance_diffuse(light, at->shading, d->r->materials.roughness[segment],
                                 views_direction(d->views, train, at->position));
    rgb typical = rgb_scale(c.white, TYPICAL_BASE_COLOR);
    /* Edges and the light of others only lower it: no ray is needed to know that it is too low. */
    if (!best_takes(&of->best, c.view.weight * noise_weight(d->noise, d->views, &c.view, typical, 0.0f), train) ||
        !views_unoccluded(d->views, train, at->position, at->normal) ||
        photograph_has_firefly(photo, c.view.x, c.view.y) ||
        !photograph_sample(photo, c.view.x, c.view.y, &s) || s.saturated[0] || s.saturated[1] || s.saturated[2])
        return;
    c.shown = s.radiance;
    c.mixing = views_mixing(d->views, &c.view, at->triangle, c.shown);
    c.sharp = sharpen(d, &c.view, at->triangle, &c.shown);
    float times_typical = rgb_mean(c.shown) / fmaxf(rgb_mean(typical), DARKEST * d->views->median_radiance);
    c.weight = c.view.weight * views_trust(d->views, &c.view, at->triangle) *
               noise_weight(d->noise, d->views, &c.view, typical, c.mixing * times_typical * times_typical);
    size_t slot = best_put(&of->best, c.weight, train);
    if (slot != BEST_NONE)
        of->candidate[slot] = c;
}

static struct robust_sample look_of(const struct divide *d, uint32_t texel, const struct surface_point *at,
                                    const struct candidate *c, struct incident *scratch) {
    const struct materials *m = &d->r->materials;
    uint32_t segment = reconstruction_segment(d->r, texel);
    float median = d->views->median_radiance, weight = c->weight;
    rgb white = c->white, gloss = rgb_gray(0.0f);
    if (m->specular[segment] > 0.0f) {
        struct highlight highlight;
        struct highlight_levels level = {1, 1, {m->roughness[segment]}, {m->specular[segment]}};
        highlight_gather(&highlight, scratch, d->field, at, views_direction(d->views, c->view.train, at->position),
                         &level, sampler_key(KEY_DIVIDE, texel, c->view.train), d->highlight_samples,
                         d->highlight_samples / 2);
        gloss = highlight.radiance[0][0];
        float both = fmaxf(d->typical[segment] * rgb_mean(white) + rgb_mean(gloss), 0.01f * median);
        float part = rgb_mean(gloss) / both * (1.0f / HIGHLIGHT_PART);
        weight /= 1.0f + part * part;
    }
    rgb fused = fused_radiance(&d->r->fused, texel), deviation = noise_deviation(d->noise, d->views, &c->view, fused);
    rgb usual = rgb_clamp(divide_channels(fused, white, DARKEST * median), 0.0f, MOST);
    rgb base = rgb_clamp(divide_channels(rgb_sub(c->shown, gloss), white, DARKEST * median), -MOST, MOST);
    rgb noise = rgb_clamp(divide_channels(deviation, white, DARKEST * median), 0.0f, MOST);
    return (struct robust_sample){
        .value = base,
        .gray = logf(fmaxf(rgb_mean(base), 0.0f) + OUTLIER_FLOOR),
        .deviation = rgb_mean(noise) / (rgb_mean(usual) + OUTLIER_FLOOR),
        .weight = weight,
        .source = c->view.train,
        .sharp = c->view.weight,
        .noise = rgb_scale(noise, noise_draw(&c->view, c->sharp)),
        .mixing = c->mixing * rgb_dot(base, base)};
}

static void look_all(const struct divide *d, uint32_t texel, struct incident *scratch,
                     struct irradiance *light, struct measured_looks *looks) {
    struct surface_point at;
    struct candidates candidates;
    looks->count = 0;
    if (!light_at(d, texel, &at, light))
        return;
    best_init(&candidates.best, candidates.item, MEASURED_LOOKS);
    for (uint32_t t = 0; t < d->views->train_count; t++)
        offer_look(d, reconstruction_segment(d->r, texel), &at, light, t, &candidates);
    for (; looks->count < candidates.best.count; looks->count++)
        looks->look[looks->count] = look_of(d, texel, &at, &candidates.candidate[looks->count], scratch);
}

static rgb texel_color(const struct reconstruction *r, uint32_t texel) {
    const float *from = r->materials.base_color.texel[texel];
    return rgb_make(from[0], from[1], from[2]);
}

/* What arrives, from everywhere. */
static rgb irradiance_sum(const struct irradiance *light) {
    const float *sum = light->moment[0];
    return rgb_make(sum[0], sum[1], sum[2]);
}

static struct measured mean_of(struct measured_looks *looks, const struct irradiance *light) {
    return measured_mean(looks, OUTLIER_SCALE, divide_channels(light->noise, irradiance_sum(light), FLT_MIN));
}

/* The texel that is measured in place of this one. */
static uint32_t stand_in(const struct divide *d, uint32_t texel) {
    const struct reconstruction *r = d->r;
    uint32_t width = r->atlas.width, x = texel % width, y = texel / width;
    uint32_t other = (y - y % d->stride) * width + x - x % d->stride;
    uint32_t triangle = r->inverse.triangle[other];
    bool same = triangle != INVERSE_UV_NONE && r->atlas.chart_of_triangle[triangle] ==
                                                   r->atlas.chart_of_triangle[r->inverse.triangle[texel]];
    return same ? other : texel;
}

static void divide_texel(struct divide *d, uint32_t texel, struct incident *scratch) {
    struct measured_looks looks;
    struct irradiance light;
    look_all(d, texel, scratch, &light, &looks);
    d->measured[texel] = (struct measured){0};
    if (looks.count > 0 && !d->r->is_emitter[reconstruction_segment(d->r, texel)])
        d->measured[texel] = mean_of(&looks, &light);
}

struct divide_list {
    struct divide *divide;
    const uint32_t *texel;
    size_t count;
};

static void divide_chunk(void *user, size_t chunk, int thread) {
    const struct divide_list *list = user;
    struct divide *d = list->divide;
    size_t begin = chunk * CHUNK, end = begin + CHUNK < list->count ? begin + CHUNK : list->count;
    for (size_t i = begin; i < end; i++) {
        if (stand_in(d, list->texel[i]) == list->texel[i])
            divide_texel(d, list->texel[i], &d->scratch[thread]);
    }
}

void divide_texels(struct divide *d, const uint32_t *texel, size_t count) {
    struct divide_list list = {d, texel, count};
    parallel_for(d->r->pool, (count + CHUNK - 1) / CHUNK, divide_chunk, &list);
}

/* What is done for each valid texel, in any order. */
struct each {
    const struct divide *divide;
    void (*of)(const void *job, uint32_t texel);
    const void *job;
};

static void each_chunk(void *user, size_t chunk, int thread) {
    (void)thread;
    const struct each *each = user;
    const struct inverse_uv *inverse = &each->divide->r->inverse;
    size_t begin = chunk * CHUNK, end = begin + CHUNK < inverse->valid_count ? begin + CHUNK : inverse->valid_count;
    for (size_t i = begin; i < end; i++)
        each->of(each->job, inverse->valid[i]);
}

static void each_valid(const struct divide *d, void (*of)(const void *job, uint32_t texel), const void *job) {
    struct each each = {d, of, job};
    parallel_for(d->r->pool, (d->r->inverse.valid_count + CHUNK - 1) / CHUNK, each_chunk, &each);
}

struct matt_job {
    const struct divide *divide;
    struct fused *matt;
};

static void matt_texel(const void *user, uint32_t texel) {
    const struct matt_job *job = user;
    const struct measured *m = &job->divide->measured[texel];
    rgb white;
    if (stand_in(job->divide, texel) != texel || !(m->weight > 0.0f) || !divide_white(job->divide, texel, &white))
        return;
    job->matt->count[texel] = m->weight;
    rgb_to_half(job->matt->radiance[texel], rgb_mul(rgb_clamp(measured_value(m), 0.0f, MOST), white));
}

void divide_matt(const struct divide *d, struct fused *matt) {
    size_t texels = (size_t)d->r->atlas.width * d->r->atlas.height;
    *matt = (struct fused){.width = d->r->atlas.width, .height = d->r->atlas.height};
    matt->radiance = mem_calloc_large(texels, sizeof *matt->radiance);
    matt->count = mem_calloc_large(texels, sizeof *matt->count);
    matt->is_bound = mem_calloc_large(texels, sizeof *matt->is_bound);
    each_valid(d, matt_texel, &(struct matt_job){d, matt});
}

struct white_job {
    const struct divide *divide;
    uint16_t (*white)[3];
};

static void white_texel(const void *user, uint32_t texel) {
    const struct white_job *job = user;
    const struct divide *d = job->divide;
    rgb white;
    bool known = d->measured[texel].weight > 0.0f && divide_white(d, texel, &white) &&
                 fminf(white.r, fminf(white.g, white.b)) > DARK * d->views->median_radiance;
    rgb_to_half(job->white[texel], known ? white : rgb_gray(0.0f));
}

void divide_white_all(const struct divide *d, uint16_t (*white)[3]) {
    each_valid(d, white_texel, &(struct white_job){d, white});
}

/* Means over what photographs show of each segment. */
static void find_typical(struct divide *d) {
    const struct reconstruction *r = d->r;
    double(*sum)[2] = mem_calloc(r->segments.count, sizeof *sum);
    for (size_t i = 0; i < r->inverse.valid_count; i++) {
        uint32_t texel = r->inverse.valid[i], segment = reconstruction_segment(r, texel);
        if (!(r->fused.count[texel] > 0.0f))
            continue;
        sum[segment][0] += (double)rgb_mean(texel_color(r, texel));
        sum[segment][1] += 1.0;
    }
    for (size_t i = 0; i < r->segments.count; i++)
        if (sum[i][1] > 0.0)
            d->typical[i] = fmaxf((float)(sum[i][0] / sum[i][1]), DARKEST_TYPICAL);
    mem_free(sum);
}

/* What was measured as it is, and the priors where nothing was. */
static void keep_noise(struct divide *d, const struct color_prior *prior) {
    struct reconstruction *r = d->r;
    for (size_t i = 0; i < r->inverse.valid_count; i++) {
        uint32_t texel = r->inverse.valid[i];
        const struct measured *m = &d->measured[texel];
        rgb value = m->weight > 0.0f ? measured_value(m)
                                     : prior[r->atlas.chart_of_triangle[r->inverse.triangle[texel]]].mean;
        float *to = r->materials.base_color.texel[texel];
        to[0] = clampf(value.r, 0.0f, 1.0f);
        to[1] = clampf(value.g, 0.0f, 1.0f);
        to[2] = clampf(value.b, 0.0f, 1.0f);
    }
}

struct sending {
    const struct divide *divide;
    const float *gloss_albedo; /* [segment_count] */
    const struct divide_sent *sent;
};

/* What a texel sends out, in the mean over viewers. (What photographs show of it is brighter: they look at floors aslant
 * and at walls towards the light.) As far as they may have told of other surfaces its base colour is what is to be
 * expected there: beside a window a thin frame would else shine like it. The sun that it mirrors is sun_caustics.h's. */
static void send_out(const void *user, uint32_t texel) {
    const struct sending *job = user;
    const struct divide *d = job->divide;
    const struct measured *m = &d->measured[texel];
    uint32_t segment = reconstruction_segment(d->r, texel);
    struct surface_point at;
    struct irradiance light;
    if (d->r->is_emitter[segment] || !light_without_sun(d, texel, &at, &light))
        return;
    bool mirrors = job->sent->lobe[segment].specular > 0.0f;
    rgb evenly = irradiance_sum(&light);
    sun_add_light(&d->r->sun, d->r->world.accel, &at, &light);
    if (!mirrors)
        evenly = irradiance_sum(&light);
    float known = m->weight > 0.0f ? MIXING_TOLD / (MIXING_TOLD + image_float_from_half(m->mixing)) : 0.0f;
    rgb measured = rgb_clamp(measured_value(m), 0.0f, MOST), expected = texel_color(d->r, texel);
    rgb base = rgb_mad(rgb_scale(expected, 1.0f - known), known, measured);
    rgb white = irradiance_diffuse_mean(&light, at.shading, d->r->materials.roughness[segment]);
    rgb matt = rgb_mul(base, white);
    rgb all = rgb_mad(matt, job->gloss_albedo[segment] * (1.0f / BSDF_PI), evenly);
    rgb_to_half(job->sent->all[texel], all);
    rgb_to_half(job->sent->unmirrored[texel], mirrors ? matt : all);
}

static void send_all(const struct divide *d, const struct divide_sent *sent) {
    const struct reconstruction *r = d->r;
    float *gloss_albedo = mem_array(r->segments.count, sizeof *gloss_albedo);
    for (uint32_t i = 0; i < r->segments.count; i++) {
        float roughness = r->materials.roughness[i], specular = r->materials.specular[i];
        bool mirrors = materials_is_polished(&r->materials, i) && !r->is_emitter[i];
        gloss_albedo[i] = highlight_albedo(roughness, specular);
        sent->lobe[i] = (struct incident_lobe){roughness, mirrors ? specular : 0.0f};
    }
    each_valid(d, send_out, &(struct sending){d, gloss_albedo, sent});
    mem_free(gloss_albedo);
}

void divide_finish(struct divide *d, const struct divide_sent *sent) {
    struct reconstruction *r = d->r;
    for (size_t i = 0; i < r->inverse.valid_count; i++)
        d->measured[r->inverse.valid[i]] = d->measured[stand_in(d, r->inverse.valid[i])];
    struct color_prior *prior = color_priors(r, d->measured);
    if (d->denoises)
        denoise(&r->atlas, &r->inverse, r->scene->mesh.triangle_count, d->measured, prior, NULL,
                &r->materials.base_color, r->pool);
    else
        keep_noise(d, prior);
    mem_free(prior);
    find_typical(d);
    send_all(d, sent);
}
