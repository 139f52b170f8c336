/* specular_observation.c -- see specular_observation.h. */
#include "server/material/specular_observation.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "server/capture/stratified.h"
#include "server/render/sampler.h"
#include "server/scene/surface.h"

/* Points of the whole room, shared out by the square roots of the segments' texel counts; sets the time of the pass. */
#define POINTS_TOTAL 60000 /* +25 %: no change */
#define MIN_POINTS 24      /* a segment; +25 %: no change */
#define TRIES 16           /* texels tried for each point wanted; +25 %: no change */
#define VIEWS_TRIED 40     /* photographs tried for each point; +25 %: no change */
/* Directions for each observation and place of the patch: by each roughness level, and towards lights. */
#define SAMPLES_A_LEVEL 1 /* to 2: +0.03 dB, specular +0.11 */
#define LIGHT_SAMPLES 5   /* to 6: 0 dB */
#define KEY_SPECULAR 17   /* random-number key, distinct from others of the texel */
#define PATCH 5 /* places a side at which photographs are read; to 6: +0.04 dB, roughness -2.29, specular -0.66 */
#define PATCHES_A_SIDE 14.0 /* patches that must fit along a side of the segment, were it square; +25 %: no change */
#define MAX_PATCH 24.0      /* side in a texture of up to 2048 texels; in proportion in larger ones; +25 %: no change */
#define MIN_NORMAL_COSINE 0.8f /* least cosine between normals of a patch and that of its middle; +25 %: no change */
#define MIN_VIEW_COSINE 0.1f   /* least cosine towards the camera, anywhere in a patch; +25 %: no change */

const struct highlight_levels specular_levels = {
    .roughness_count = HIGHLIGHT_ROUGHNESSES,
    .specular_count = HIGHLIGHT_SPECULARS,
    .roughness = {0.05f, 0.1f, 0.15f, 0.2f, 0.25f, 0.3f, 0.375f, 0.45f, 0.55f, 0.65f, 0.8f, 1.0f},
    .specular = {0.125f, 0.25f, 0.5f, 0.75f, 1.0f},
};

/* Places of a patch, and their positions in the texture. */
struct specular_patch {
    size_t count;
    struct surface_point at[PATCH * PATCH];
    vec2 texture[PATCH * PATCH];
};

/* Places around a texel that are in its chart and have similar normals. */
static void patch_around(const struct specular_observer *l, uint32_t texel, float side, struct specular_patch *patch) {
    const struct surface *s = &l->in.surface;
    struct surface_point at;
    patch->count = 0;
    if (!surface_at_texel(s->mesh, s->atlas, s->inverse, texel, &at))
        return;
    uint32_t chart = s->atlas->chart_of_triangle[at.triangle];
    float x0 = (float)(texel % s->atlas->width) + 0.5f, y0 = (float)(texel / s->atlas->width) + 0.5f;
    for (int i = 0; i < PATCH * PATCH; i++) {
        struct surface_point p;
        float dx = ((float)(i % PATCH) + 0.5f) / PATCH - 0.5f, dy = ((float)(i / PATCH) + 0.5f) / PATCH - 0.5f;
        float x = x0 + side * dx, y = y0 + side * dy;
        if (!surface_at(s->mesh, s->atlas, s->inverse, x, y, &p) || s->atlas->chart_of_triangle[p.triangle] != chart ||
            vec3_dot(p.shading, at.shading) < MIN_NORMAL_COSINE)
            continue;
        patch->texture[patch->count] = (vec2){x, y};
        patch->at[patch->count++] = p;
    }
}

/* Irradiance at a place of a patch. */
static void light_at(const struct specular_observer *l, const struct specular_patch *patch, size_t i,
                     struct irradiance *light) {
    const struct atlas *atlas = l->in.surface.atlas;
    struct probe_mix mix;
    uint32_t texel = (uint32_t)patch->texture[i].y * atlas->width + (uint32_t)patch->texture[i].x;
    probes_mix(l->in.probes, atlas, l->in.fused, texel, &patch->at[i], &mix);
    probes_irradiance(l->in.probes, &mix, light);
    sun_add_light(l->in.sun, l->in.field->world->accel, &patch->at[i], light);
}

/* Sums over the positions at which a photograph is read, pixels. */
struct read_places {
    double count, x, y, xx, xy, yy;
};

static void read_at(struct read_places *sums, double x, double y) {
    sums->count += 1.0;
    sums->x += x;
    sums->y += y;
    sums->xx += x * x;
    sums->xy += x * y;
    sums->yy += y * y;
}

/* As many independent pixels have the variance of the look-ups' mean. An even distribution over an area A has a
 * covariance of determinant A^2 / 144. The interpolation of one look-up spreads over 9/4 pixels. */
static double pixels_read(const struct read_places *sums) {
    const double one = 9.0 / 4.0, spread = one / 12.0;
    double x = sums->x / sums->count, y = sums->y / sums->count, xy = sums->xy / sums->count - x * y;
    double xx = fmax(sums->xx / sums->count - x * x, 0.0), yy = fmax(sums->yy / sums->count - y * y, 0.0);
    double area = 12.0 * sqrt(fmax((xx + spread) * (yy + spread) - xy * xy, spread * spread));
    return fmin(area, one * sums->count);
}

/* Mean radiance of the patch in a photograph, and its noise. False unless every place faces the camera, has a valid
 * sample and is no nearer to an edge than class `edge`. */
static bool patch_observed(const struct specular_input *in, const struct view *view, const struct specular_patch *patch,
                           int edge, rgb *observed, rgb *deviation) {
    const struct views *views = in->views;
    const struct photograph *photo = &views->scene->photograph[views->train[view->train]];
    struct read_places places = {0};
    *observed = rgb_gray(0.0f);
    for (size_t i = 0; i < patch->count; i++) {
        const struct surface_point *at = &patch->at[i];
        struct view place = *view;
        struct photograph_sample s;
        float depth_m;
        if (vec3_dot(at->shading, views_direction(views, view->train, at->position)) < MIN_VIEW_COSINE ||
            !camera_project(&photo->camera, at->position, &place.x, &place.y, &depth_m) ||
            views_edge(views, &place, at->triangle) > edge || photograph_has_firefly(photo, place.x, place.y) ||
            !photograph_sample(photo, place.x, place.y, &s) || photograph_sample_saturates(&s))
            return false;
        *observed = rgb_mad(*observed, 1.0f / (float)patch->count, s.radiance);
        read_at(&places, (double)place.x, (double)place.y);
    }
    if (patch->count == 0)
        return false;
    *deviation =
        rgb_scale(noise_deviation(in->noise, views, view, *observed), (float)(1.0 / sqrt(pixels_read(&places))));
    return true;
}

/* Adds what each candidate reflects towards a photograph from a place of the patch, times `share`. */
static void add_place(const struct specular_observer *l, const struct surface_point *at, const struct irradiance *light,
                      uint32_t key, uint32_t train, float share, struct incident *scratch,
                      struct specular_prediction *prediction) {
    struct highlight highlight;
    vec3 wo = views_direction(l->in.views, train, at->position);
    highlight_gather(&highlight, scratch, l->in.field, at, wo, &specular_levels, key,
                     SAMPLES_A_LEVEL * HIGHLIGHT_ROUGHNESSES, LIGHT_SAMPLES);
    for (size_t k = 0; k < HIGHLIGHT_ROUGHNESSES; k++) {
        rgb unit_diffuse = irradiance_diffuse(light, at->shading, specular_levels.roughness[k], wo);
        prediction->unit_diffuse[k] = rgb_mad(prediction->unit_diffuse[k], share, unit_diffuse);
        for (size_t m = 0; m < HIGHLIGHT_SPECULARS; m++)
            prediction->highlight.radiance[k][m] =
                rgb_mad(prediction->highlight.radiance[k][m], share, highlight.radiance[k][m]);
    }
}

void specular_predict(const struct specular_observer *l, const struct specular_sample *sample, int thread,
                      struct specular_prediction *prediction) {
    struct specular_patch patch;
    patch_around(l, sample->texel, sample->patch, &patch);
    float share = 1.0f / (float)patch.count;
    memset(prediction, 0, sample->count * sizeof *prediction);
    for (size_t i = 0; i < patch.count; i++) {
        struct irradiance light;
        light_at(l, &patch, i, &light);
        for (size_t k = 0; k < sample->count; k++)
            add_place(l, &patch.at[i], &light, sampler_key(KEY_SPECULAR + i, sample->texel, sample->view[k].train),
                      sample->view[k].train, share, &l->scratch[thread], &prediction[k]);
    }
}

static bool observe_texel(const struct specular_observer *l, uint32_t texel, struct specular_criteria criteria,
                          struct specular_sample *sample) {
    struct specular_patch patch;
    struct view view[VIEWS_TRIED];
    *sample = (struct specular_sample){.texel = texel, .patch = criteria.patch};
    patch_around(l, texel, criteria.patch, &patch);
    if (patch.count == 0)
        return false;
    const struct surface_point *middle = &patch.at[patch.count / 2];
    sample->position = middle->position;
    size_t view_count = views_pick(l->in.views, middle->position, middle->normal, texel, VIEWS_TRIED, view);
    for (size_t i = 0; i < view_count && sample->count < SPECULAR_VIEWS; i++) {
        size_t k = sample->count;
        sample->view[k].train = view[i].train;
        sample->count += patch_observed(&l->in, &view[i], &patch, criteria.edge, &sample->view[k].observed,
                                        &sample->view[k].deviation);
    }
    return sample->count >= criteria.least;
}

size_t specular_points_wanted(const struct specular_observer *l, size_t segment) {
    double texels = (double)by_segment_count(&l->texels, segment);
    size_t points = (size_t)(POINTS_TOTAL * sqrt(texels) / l->root_sum);
    return points < MIN_POINTS ? MIN_POINTS : points > SPECULAR_MAX_POINTS ? SPECULAR_MAX_POINTS : points;
}

float specular_widest_patch(const struct specular_observer *l, size_t segment) {
    const struct atlas *atlas = l->in.surface.atlas;
    double texture = (double)(atlas->width > atlas->height ? atlas->width : atlas->height);
    double side = sqrt((double)by_segment_count(&l->texels, segment)) / PATCHES_A_SIDE;
    return fmaxf(SPECULAR_MIN_PATCH, (float)fmin(side, MAX_PATCH * fmax(1.0, texture / 2048.0)));
}

size_t specular_tries(const struct specular_observer *l, size_t segment) {
    size_t tries = TRIES * specular_points_wanted(l, segment), texels = by_segment_count(&l->texels, segment);
    return tries < texels ? tries : texels;
}

bool specular_observe(const struct specular_observer *l, size_t segment, size_t attempt,
                      struct specular_criteria criteria, struct specular_sample *sample) {
    uint32_t texels = (uint32_t)by_segment_count(&l->texels, segment);
    const uint32_t *texel = &l->texels.texel[l->texels.first[segment]];
    return observe_texel(l, texel[attempt * stratified_even_step(texels) % texels], criteria, sample);
}

void specular_observer_init(struct specular_observer *l, const struct specular_input *input, int threads) {
    const struct segments *segments = input->surface.segments;
    *l = (struct specular_observer){.in = *input};
    l->scratch = mem_array((size_t)threads, sizeof *l->scratch);
    by_segment_sort(&l->texels, segments, input->surface.inverse);
    for (size_t i = 0; i < segments->count; i++)
        l->root_sum += sqrt((double)by_segment_count(&l->texels, i));
}

void specular_observer_release(struct specular_observer *l) {
    by_segment_release(&l->texels);
    mem_free(l->scratch);
}
