/* divide.c -- see divide.h. */
#include "server/material/divide.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "common/image.h"
#include "common/mem.h"
#include "common/quantile.h"
#include "server/capture/top_k.h"
#include "server/gather/highlight.h"
#include "server/material/color_prior.h"
#include "server/render/bsdf.h"
#include "server/render/sampler.h"
#include "server/scene/rgb_half.h"

#define CHUNK 256 /* texels a work item */
/* Directions of one highlight, at most and at least, and half as many samples of lights. Highlights of all texels under
 * one pixel are averaged, so these need SAMPLES_PER_PIXEL together. */
#define MAX_SAMPLES 16          /* +25 %: +0.01 dB */
#define MIN_SAMPLES 4           /* +25 %: no change */
#define SAMPLES_PER_PIXEL 128.0 /* +25 %: no change */
#define KEY_DIVIDE 5            /* random-number key, distinct from others of the texel */
/* Deviation from the median, in the logarithm of base colour, at which an observation has half its weight; dark base
 * colours have OUTLIER_FLOOR added first. */
#define OUTLIER_SCALE 0.3f  /* +25 %: -0.01 dB */
#define OUTLIER_FLOOR 0.03f /* +25 %: 0 dB */
/* Part of the expected radiance that is highlight at which an observation has half its weight; least base colour that
 * the expectation assumes. */
#define HIGHLIGHT_PART 0.2f /* +25 %: -0.01 dB */
#define MIN_TYPICAL 0.02f   /* +25 %: no change */
/* Base colour assumed for the noise weights. With a texel's own, bright texels would outweigh dark ones wherever
 * neighbours are averaged, and dark tiles between white joints would turn grey. */
#define TYPICAL_BASE_COLOR 0.5f /* +25 %: +0.02 dB */
/* Lower bounds of Lambert radiance, parts of the median radiance: of the divisor, and for use by detail.h. */
#define MIN_LAMBERT 1e-4f        /* +25 %: no change */
#define MIN_LAMBERT_DETAIL 1e-3f /* +25 %: no change */

size_t divide_highlight_samples(double texels_per_pixel) {
    double samples = SAMPLES_PER_PIXEL / fmax(texels_per_pixel, 1.0);
    return (size_t)fmin(fmax(samples, MIN_SAMPLES), MAX_SAMPLES);
}

bool divide_light_without_sun(const struct divide *d, uint32_t texel, struct surface_point *at,
                              struct irradiance *light) {
    const struct surface *s = &d->surface;
    struct probe_mix mix;
    if (!surface_at_texel(s->mesh, s->atlas, s->inverse, texel, at))
        return false;
    probes_mix(d->probes, s->atlas, d->fused, texel, at, &mix);
    probes_irradiance(d->probes, &mix, light);
    return true;
}

void divide_add_sun(const struct divide *d, const struct surface_point *at, float fraction, struct irradiance *light) {
    if (fraction != 0.0f)
        irradiance_add(light, at->shading, d->sun->direction, rgb_scale(d->sun->irradiance, fraction));
}

static bool light_at(const struct divide *d, uint32_t texel, struct surface_point *at, struct irradiance *light) {
    if (!divide_light_without_sun(d, texel, at, light))
        return false;
    divide_add_sun(d, at, sun_shadows_at(d->shadows, texel), light);
    return true;
}

bool divide_lambert(const struct divide *d, uint32_t texel, rgb *lambert) {
    struct surface_point at;
    struct irradiance light;
    if (!light_at(d, texel, &at, &light))
        return false;
    *lambert = irradiance_diffuse(&light, at.shading, 1.0f, at.shading);
    return true;
}

static rgb divide_channels(rgb over, rgb under, float least) {
    return rgb_make(over.r / fmaxf(under.r, least), over.g / fmaxf(under.g, least), over.b / fmaxf(under.b, least));
}

static const struct photograph *photograph_of(const struct divide *d, uint32_t train) {
    return &d->views->scene->photograph[d->views->train[train]];
}

/* Reads a photograph with a bicubic filter where all of its support shows one surface; else leaves `observed` as it is
 * and returns false. */
static bool sharpen(const struct divide *d, const struct view *view, uint32_t triangle, rgb *observed) {
    return views_edge(d->views, view, triangle) < VIEWS_EDGE - 1 &&
           photograph_sample_cubic(photograph_of(d, view->train), view->x, view->y, observed);
}

/* An observation whose highlight is not gathered yet. */
struct divide_candidate {
    struct view view;
    rgb observed, unit_diffuse;
    float weight, mixing;
    bool sharp, saturated[3]; /* by channel: `observed` is a lower bound */
};

/* The photographs of a texel with the greatest weights. */
struct divide_candidates {
    struct top_k best;
    struct top_k_item item[MEASUREMENT_OBSERVATIONS];
    struct divide_candidate candidate[MEASUREMENT_OBSERVATIONS];
};

static bool is_saturated(const struct divide_candidate *c) {
    return c->saturated[0] || c->saturated[1] || c->saturated[2];
}

/* What the diffuse lobe shows of the light in a photograph. */
static rgb unit_diffuse_of(const struct divide *d, uint32_t texel, const struct surface_point *at,
                           const struct irradiance *light, const struct view *view) {
    float roughness = d->materials->roughness[surface_segment(&d->surface, texel)];
    return irradiance_diffuse(light, at->shading, roughness, views_direction(d->views, view->train, at->position));
}

/* Near the edge of a shadow of the sun, as the photograph shows it, unit_diffuse has as much of the sun as it averages
 * there; false elsewhere. */
static bool blur_shadow(const struct divide *d, uint32_t texel, const struct surface_point *at,
                        const struct irradiance *light, struct divide_candidate *c) {
    const struct surface *s = &d->surface;
    struct irradiance blurred = *light;
    struct footprint pixel;
    float seen;
    if (!sun_shadows_blurs(d->shadows, texel) ||
        !footprint_of_triangle(&pixel, s->mesh, s->atlas, &photograph_of(d, c->view.train)->camera, (uint32_t)c->view.x,
                               (uint32_t)c->view.y, s->inverse->triangle[texel]) ||
        !sun_shadows_seen(d->shadows, texel, &pixel, &seen))
        return false;
    divide_add_sun(d, at, seen - sun_shadows_at(d->shadows, texel), &blurred);
    c->unit_diffuse = unit_diffuse_of(d, texel, at, &blurred, &c->view);
    return true;
}

/* Adds photograph `train` of the texel if it has a sample there and is among the best. One at the end of half precision
 * is none: no surface reflects that much. */
static void add_candidate(const struct divide *d, uint32_t texel, const struct surface_point *at,
                          const struct irradiance *light, uint32_t train, struct divide_candidates *of) {
    const struct photograph *photo = photograph_of(d, train);
    struct divide_candidate c;
    struct photograph_sample s;
    if (!views_faces(d->views, train, at->position, at->normal, &c.view))
        return;
    views_weigh(d->views, surface_texel_m2(d->surface.mesh, d->surface.atlas, at->triangle), &c.view);
    c.unit_diffuse = unit_diffuse_of(d, texel, at, light, &c.view);
    rgb typical = rgb_scale(c.unit_diffuse, TYPICAL_BASE_COLOR);
    /* An upper bound of the weight: edges and mixing only lower it. Saves the visibility ray. */
    if (!top_k_takes(&of->best, c.view.weight * noise_weight(d->noise, d->views, &c.view, typical, 0.0f), train) ||
        !views_unoccluded(d->views, train, at->position, at->normal) ||
        photograph_has_firefly(photo, c.view.x, c.view.y) || !photograph_sample(photo, c.view.x, c.view.y, &s) ||
        (photo->is_hdr && photograph_sample_saturates(&s)))
        return;
    c.observed = s.radiance;
    memcpy(c.saturated, s.saturated, sizeof c.saturated);
    c.mixing = views_mixing(d->views, &c.view, at->triangle, c.observed);
    bool is_blurred = blur_shadow(d, texel, at, light, &c);
    c.sharp = !is_blurred && !is_saturated(&c) && sharpen(d, &c.view, at->triangle, &c.observed);
    float times_typical = rgb_mean(c.observed) / fmaxf(rgb_mean(typical), MIN_LAMBERT * d->views->median_radiance);
    c.weight = c.view.weight * views_edge_weight(d->views, &c.view, at->triangle) *
               noise_weight(d->noise, d->views, &c.view, typical, c.mixing * times_typical * times_typical);
    size_t slot = top_k_put(&of->best, c.weight, train);
    if (slot != TOP_K_NONE)
        of->candidate[slot] = c;
}

static struct robust_sample observation_of(const struct divide *d, uint32_t texel, const struct surface_point *at,
                                           const struct divide_candidate *c, struct incident *scratch) {
    const struct materials *m = d->materials;
    uint32_t segment = surface_segment(&d->surface, texel);
    float median = d->views->median_radiance, weight = c->weight;
    rgb unit_diffuse = c->unit_diffuse, specular = rgb_gray(0.0f);
    if (m->specular[segment] > 0.0f) {
        struct highlight highlight;
        struct highlight_levels level = {1, 1, {m->roughness[segment]}, {m->specular[segment]}};
        vec3 wo = views_direction(d->views, c->view.train, at->position);
        highlight_gather(&highlight, scratch, d->field, at, wo, &level, sampler_key(KEY_DIVIDE, texel, c->view.train),
                         d->highlight_samples, d->highlight_samples / 2);
        specular = highlight.radiance[0][0];
        float both = fmaxf(d->typical[segment] * rgb_mean(unit_diffuse) + rgb_mean(specular), 0.01f * median);
        float part = rgb_mean(specular) / both * (1.0f / HIGHLIGHT_PART);
        weight /= 1.0f + part * part;
    }
    rgb fused = fused_radiance(d->fused, texel), deviation = noise_deviation(d->noise, d->views, &c->view, fused);
    rgb usual = rgb_clamp(divide_channels(fused, unit_diffuse, MIN_LAMBERT * median), 0.0f, DIVIDE_MAX_ALBEDO);
    rgb base = rgb_clamp(divide_channels(rgb_sub(c->observed, specular), unit_diffuse, MIN_LAMBERT * median),
                         -DIVIDE_MAX_ALBEDO, DIVIDE_MAX_ALBEDO);
    rgb noise = rgb_clamp(divide_channels(deviation, unit_diffuse, MIN_LAMBERT * median), 0.0f, DIVIDE_MAX_ALBEDO);
    return (struct robust_sample){.value = base,
                                  .gray = logf(fmaxf(rgb_mean(base), 0.0f) + OUTLIER_FLOOR),
                                  .deviation = rgb_mean(noise) / (rgb_mean(usual) + OUTLIER_FLOOR),
                                  .weight = weight,
                                  .source = c->view.train,
                                  .sharp = c->view.weight,
                                  .noise = rgb_scale(noise, noise_draw(&c->view, c->sharp)),
                                  .mixing = c->mixing * rgb_dot(base, base)};
}

/* Whether most of the observations of a texel say no more than a lower bound, by the median of their brightness. */
static bool is_bound(const struct divide_candidates *of, const struct measurement_observations *observations) {
    struct bounded gray[MEASUREMENT_OBSERVATIONS];
    float median;
    bool any = false;
    for (size_t i = 0; i < observations->count; i++) {
        gray[i] = (struct bounded){observations->observation[i].gray, is_saturated(&of->candidate[i])};
        any = any || gray[i].is_bound;
    }
    return any && !quantile_bounded_median(gray, observations->count, &median);
}

/* Leaves out the observations that saturate. But if the median is a lower bound those that do not are what noise or a
 * shadow has left below, and would say that white is grey: then only the greatest bound is kept. Returns which channels
 * of it are one (measurement.bounds). */
static uint8_t settle_bounds(const struct divide_candidates *of, struct measurement_observations *observations) {
    bool bound = is_bound(of, observations);
    uint8_t bounds = 0;
    struct robust_sample *observation = observations->observation, greatest = {.gray = -INFINITY};
    size_t kept = 0, count = observations->count;
    for (size_t i = 0; i < count; i++) {
        const struct divide_candidate *c = &of->candidate[i];
        if (bound && is_saturated(c) && observation[i].gray > greatest.gray) {
            greatest = observation[i];
            bounds = (uint8_t)(c->saturated[0] | c->saturated[1] << 1 | c->saturated[2] << 2);
        } else if (!bound && !is_saturated(c)) {
            observation[kept++] = observation[i];
        }
    }
    if (bound)
        observation[kept++] = greatest;
    observations->count = kept;
    return bounds;
}

/* Returns measurement.bounds of what is observed. */
static uint8_t observe_all(const struct divide *d, uint32_t texel, struct incident *scratch, struct irradiance *light,
                           struct measurement_observations *observations) {
    struct surface_point at;
    struct divide_candidates candidates;
    observations->count = 0;
    if (!light_at(d, texel, &at, light))
        return 0;
    top_k_init(&candidates.best, candidates.item, MEASUREMENT_OBSERVATIONS);
    for (uint32_t t = 0; t < d->views->train_count; t++)
        add_candidate(d, texel, &at, light, t, &candidates);
    for (; observations->count < candidates.best.count; observations->count++)
        observations->observation[observations->count] =
            observation_of(d, texel, &at, &candidates.candidate[observations->count], scratch);
    return settle_bounds(&candidates, observations);
}

rgb divide_color(const struct divide *d, uint32_t texel) {
    const float *from = d->materials->base_color.texel[texel];
    return rgb_make(from[0], from[1], from[2]);
}

static struct measurement mean_of(struct measurement_observations *observations, const struct irradiance *light) {
    return measurement_mean(observations, OUTLIER_SCALE,
                            divide_channels(light->noise, irradiance_flux(light), FLT_MIN));
}

/* The texel whose measurement this one takes: its own, or that of its stride x stride block. */
static uint32_t source_texel(const struct divide *d, uint32_t texel) {
    const struct surface *s = &d->surface;
    uint32_t width = s->atlas->width, x = texel % width, y = texel / width;
    uint32_t other = (y - y % d->stride) * width + x - x % d->stride;
    bool is_valid = s->inverse->triangle[other] != INVERSE_UV_NONE;
    return is_valid && surface_chart(s, other) == surface_chart(s, texel) ? other : texel;
}

static void divide_texel(struct divide *d, uint32_t texel, struct incident *scratch) {
    struct measurement_observations observations;
    struct irradiance light;
    uint8_t bounds = observe_all(d, texel, scratch, &light, &observations);
    d->measured[texel] = (struct measurement){0};
    if (observations.count > 0 && !d->is_emitter[surface_segment(&d->surface, texel)]) {
        d->measured[texel] = mean_of(&observations, &light);
        d->measured[texel].bounds = bounds;
    }
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
        if (source_texel(d, list->texel[i]) == list->texel[i])
            divide_texel(d, list->texel[i], &d->scratch[thread]);
    }
}

void divide_texels(struct divide *d, const uint32_t *texel, size_t count) {
    struct divide_list list = {d, texel, count};
    parallel_for(d->pool, (count + CHUNK - 1) / CHUNK, divide_chunk, &list);
}

/* A function called for each valid texel. */
struct each {
    const struct divide *divide;
    void (*of)(const void *job, uint32_t texel);
    const void *job;
};

static void each_chunk(void *user, size_t chunk, int thread) {
    (void)thread;
    const struct each *each = user;
    const struct inverse_uv *inverse = each->divide->surface.inverse;
    size_t begin = chunk * CHUNK, end = begin + CHUNK < inverse->valid_count ? begin + CHUNK : inverse->valid_count;
    for (size_t i = begin; i < end; i++)
        each->of(each->job, inverse->valid[i]);
}

void divide_each(const struct divide *d, void (*of)(const void *job, uint32_t texel), const void *job) {
    struct each each = {d, of, job};
    parallel_for(d->pool, (d->surface.inverse->valid_count + CHUNK - 1) / CHUNK, each_chunk, &each);
}

struct diffuse_job {
    const struct divide *divide;
    struct fused *diffuse;
};

static void diffuse_texel(const void *user, uint32_t texel) {
    const struct diffuse_job *job = user;
    const struct measurement *m = &job->divide->measured[texel];
    rgb lambert;
    if (source_texel(job->divide, texel) != texel || !(m->weight > 0.0f) || job->divide->fused->is_bound[texel] ||
        !divide_lambert(job->divide, texel, &lambert))
        return;
    job->diffuse->count[texel] = m->weight;
    rgb_to_half(job->diffuse->radiance[texel],
                rgb_mul(rgb_clamp(measurement_value(m), 0.0f, DIVIDE_MAX_ALBEDO), lambert));
}

void divide_diffuse(const struct divide *d, struct fused *diffuse) {
    uint32_t width = d->surface.atlas->width, height = d->surface.atlas->height;
    size_t texels = (size_t)width * height;
    *diffuse = (struct fused){.width = width, .height = height};
    diffuse->radiance = mem_calloc_large(texels, sizeof *diffuse->radiance);
    diffuse->count = mem_calloc_large(texels, sizeof *diffuse->count);
    diffuse->is_bound = mem_calloc_large(texels, sizeof *diffuse->is_bound);
    divide_each(d, diffuse_texel, &(struct diffuse_job){d, diffuse});
}

struct lambert_job {
    const struct divide *divide;
    uint16_t (*lambert)[3];
};

static void lambert_texel(const void *user, uint32_t texel) {
    const struct lambert_job *job = user;
    const struct divide *d = job->divide;
    rgb lambert;
    bool known = d->measured[texel].weight > 0.0f && divide_lambert(d, texel, &lambert) &&
                 fminf(lambert.r, fminf(lambert.g, lambert.b)) > MIN_LAMBERT_DETAIL * d->views->median_radiance;
    rgb_to_half(job->lambert[texel], known ? lambert : rgb_gray(0.0f));
}

void divide_lambert_all(const struct divide *d, uint16_t (*lambert)[3]) {
    divide_each(d, lambert_texel, &(struct lambert_job){d, lambert});
}

/* Mean base colour over the observed texels of each segment. */
static void find_typical(struct divide *d) {
    const struct inverse_uv *inverse = d->surface.inverse;
    size_t segments = d->surface.segments->count;
    double(*sum)[2] = mem_calloc(segments, sizeof *sum);
    for (size_t i = 0; i < inverse->valid_count; i++) {
        uint32_t texel = inverse->valid[i], segment = surface_segment(&d->surface, texel);
        if (!(d->fused->count[texel] > 0.0f))
            continue;
        sum[segment][0] += (double)rgb_mean(divide_color(d, texel));
        sum[segment][1] += 1.0;
    }
    for (size_t i = 0; i < segments; i++)
        if (sum[i][1] > 0.0)
            d->typical[i] = fmaxf((float)(sum[i][0] / sum[i][1]), MIN_TYPICAL);
    mem_free(sum);
}

/* Base colour as measured, and the prior where it was not. */
static void keep_measured(struct divide *d, const struct color_prior *prior) {
    const struct inverse_uv *inverse = d->surface.inverse;
    for (size_t i = 0; i < inverse->valid_count; i++) {
        uint32_t texel = inverse->valid[i];
        const struct measurement *m = &d->measured[texel];
        rgb value = m->weight > 0.0f ? measurement_value(m) : prior[surface_chart(&d->surface, texel)].mean;
        float *to = d->materials->base_color.texel[texel];
        to[0] = clampf(value.r, 0.0f, 1.0f);
        to[1] = clampf(value.g, 0.0f, 1.0f);
        to[2] = clampf(value.b, 0.0f, 1.0f);
        rgb noise = rgb_from_half(m->noise);
        float variance = m->weight > 0.0f ? rgb_dot(noise, noise) + image_float_from_half(m->mixing)
                                          : prior[surface_chart(&d->surface, texel)].variance;
        if (d->materials->deviation)
            d->materials->deviation[texel] = image_half_from_float(sqrtf(variance / 3.0f));
    }
}

void divide_finish(struct divide *d) {
    const struct surface *s = &d->surface;
    for (size_t i = 0; i < s->inverse->valid_count; i++)
        d->measured[s->inverse->valid[i]] = d->measured[source_texel(d, s->inverse->valid[i])];
    struct color_prior *prior = color_priors(s, d->is_emitter, d->measured, d->pool);
    if (d->denoises)
        denoise(s->atlas, s->inverse, s->mesh->triangle_count, d->measured, prior, NULL, &d->materials->base_color,
                d->stride, d->materials->deviation, d->pool);
    else
        keep_measured(d, prior);
    mem_free(prior);
    find_typical(d);
}
