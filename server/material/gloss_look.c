/* gloss_look.c -- see gloss_look.h. */
#include "server/material/gloss_look.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "server/capture/choose.h"
#include "server/render/sampler.h"
#include "server/scene/surface.h"

/* Texels that are looked at in all; a segment's share of them goes by the root of its share of the texels. */
#define POINTS_IN_ALL 60000
#define POINTS_LEAST 24
#define TRIES 16 /* texels tried for one that is looked at */
#define VIEWS_ASKED 40 /* of which those far from edges are taken */
/* Directions a photograph and place of the patch: of each roughness level, and of the lights. */
#define SAMPLES_A_LEVEL 1
#define LIGHT_SAMPLES 5
#define KEY_GLOSS 17 /* keeps these random numbers apart from others of the texel */
#define PATCH 5 /* places a side at which photographs are read */
#define PATCHES_A_SIDE 14.0 /* for which a segment, were it square, must have room */
#define PATCH_WIDEST 24.0   /* texels, or this part of a texture of 2048 texels a side where it is larger */
#define PATCH_COSINE 0.8f /* between its normals and that in its middle */
#define FACING 0.1f       /* cosine at which all of it must face a photograph */

const struct highlight_levels gloss_levels = {
    .roughness_count = HIGHLIGHT_ROUGHNESSES,
    .specular_count = HIGHLIGHT_SPECULARS,
    .roughness = {0.05f, 0.1f, 0.15f, 0.2f, 0.25f, 0.3f, 0.375f, 0.45f, 0.55f, 0.65f, 0.8f, 1.0f},
    .specular = {0.125f, 0.25f, 0.5f, 0.75f, 1.0f},
};

/* A few texels of a chart. */
struct patch {
    size_t count;
    struct surface_point at[PATCH * PATCH];
    struct irradiance light[PATCH * PATCH];
};

/* Points of the surface around a texel, of its chart and not too unlike in their normals. */
static void patch_around(const struct gloss_looker *l, uint32_t texel, float side, struct patch *patch) {
    const struct reconstruction *r = l->r;
    struct surface_point at;
    patch->count = 0;
    if (!surface_at_texel(&r->scene->mesh, &r->atlas, &r->inverse, texel, &at))
        return;
    uint32_t chart = r->atlas.chart_of_triangle[at.triangle];
    float x0 = (float)(texel % r->atlas.width) + 0.5f, y0 = (float)(texel / r->atlas.width) + 0.5f;
    for (int i = 0; i < PATCH * PATCH; i++) {
        struct surface_point p;
        struct probe_mix mix;
        float dx = ((float)(i % PATCH) + 0.5f) / PATCH - 0.5f, dy = ((float)(i / PATCH) + 0.5f) / PATCH - 0.5f;
        float x = x0 + side * dx, y = y0 + side * dy;
        if (!surface_at(&r->scene->mesh, &r->atlas, &r->inverse, x, y, &p) ||
            r->atlas.chart_of_triangle[p.triangle] != chart || vec3_dot(p.shading, at.shading) < PATCH_COSINE)
            continue;
        probes_mix(l->probes, &r->atlas, &r->fused, (uint32_t)y * r->atlas.width + (uint32_t)x, &p, &mix);
        probes_irradiance(l->probes, &mix, &patch->light[patch->count]);
        sun_add_light(&r->sun, r->world.accel, &p, &patch->light[patch->count]);
        patch->at[patch->count++] = p;
    }
}

/* What a photograph shows of the patch on average; false unless all of it faces it and was measured, no
 * nearer to edges than `edge`. */
static bool patch_shown(const struct views *views, const struct view *view, const struct patch *patch, int edge,
                        rgb *shown) {
    const struct photograph *photo = &views->scene->photograph[views->train[view->train]];
    *shown = rgb_gray(0.0f);
    for (size_t i = 0; i < patch->count; i++) {
        const struct surface_point *at = &patch->at[i];
        struct view place = *view;
        struct photograph_sample s;
        float depth_m;
        if (vec3_dot(at->shading, views_direction(views, view->train, at->position)) < FACING ||
            !camera_project(&photo->camera, at->position, &place.x, &place.y, &depth_m) ||
            views_edge(views, &place, at->triangle) > edge || photograph_has_firefly(photo, place.x, place.y) ||
            !photograph_sample(photo, place.x, place.y, &s) || s.saturated[0] || s.saturated[1] || s.saturated[2])
            return false;
        *shown = rgb_mad(*shown, 1.0f / (float)patch->count, s.radiance);
    }
    return patch->count > 0;
}

/* What all candidates send to a photograph, the mean over the patch. */
static void predict(const struct gloss_looker *l, const struct patch *patch, uint32_t texel, uint32_t train,
                    struct incident *scratch, struct gloss_look *look) {
    float share = 1.0f / (float)patch->count;
    memset(look->white, 0, sizeof look->white);
    memset(&look->highlight, 0, sizeof look->highlight);
    for (size_t i = 0; i < patch->count; i++) {
        const struct surface_point *at = &patch->at[i];
        struct highlight highlight;
        vec3 wo = views_direction(l->views, train, at->position);
        highlight_gather(&highlight, scratch, l->field, at, wo, &gloss_levels,
                         sampler_key(KEY_GLOSS + i, texel, train), SAMPLES_A_LEVEL * HIGHLIGHT_ROUGHNESSES, LIGHT_SAMPLES);
        for (size_t k = 0; k < HIGHLIGHT_ROUGHNESSES; k++) {
            rgb white = irradiance_diffuse(&patch->light[i], at->shading, gloss_levels.roughness[k], wo);
            look->white[k] = rgb_mad(look->white[k], share, white);
            for (size_t m = 0; m < HIGHLIGHT_SPECULARS; m++)
                look->highlight.radiance[k][m] =
                    rgb_mad(look->highlight.radiance[k][m], share, highlight.radiance[k][m]);
        }
    }
}

static bool look_at_texel(const struct gloss_looker *l, uint32_t texel, struct gloss_way way,
                          struct incident *scratch, struct gloss_point *point) {
    struct patch patch;
    struct view view[VIEWS_ASKED];
    size_t shown_count = 0;
    point->count = 0;
    patch_around(l, texel, way.patch, &patch);
    if (patch.count == 0)
        return false;
    const struct surface_point *middle = &patch.at[patch.count / 2];
    size_t seen = views_pick(l->views, middle->position, middle->normal, texel, VIEWS_ASKED, view);
    for (size_t i = 0; i < seen && shown_count < GLOSS_VIEWS; i++) {
        if (patch_shown(l->views, &view[i], &patch, way.edge, &point->look[shown_count].shown))
            view[shown_count++] = view[i];
    }
    if (shown_count < way.least)
        return false;
    for (size_t i = 0; i < shown_count; i++)
        predict(l, &patch, texel, view[i].train, scratch, &point->look[i]);
    point->count = shown_count;
    return true;
}

size_t gloss_points_of(const struct gloss_looker *l, size_t segment) {
    double texels = (double)(l->texels.first[segment + 1] - l->texels.first[segment]);
    size_t points = (size_t)(POINTS_IN_ALL * sqrt(texels) / l->roots);
    return points < POINTS_LEAST ? POINTS_LEAST : points > GLOSS_POINTS_MOST ? GLOSS_POINTS_MOST : points;
}

float gloss_widest_patch(const struct gloss_looker *l, size_t segment) {
    const struct atlas *atlas = &l->r->atlas;
    double texture = (double)(atlas->width > atlas->height ? atlas->width : atlas->height);
    double side = sqrt((double)(l->texels.first[segment + 1] - l->texels.first[segment])) / PATCHES_A_SIDE;
    return fmaxf(GLOSS_PATCH_LEAST, (float)fmin(side, PATCH_WIDEST * fmax(1.0, texture / 2048.0)));
}

size_t gloss_look_at(const struct gloss_looker *l, size_t segment, struct gloss_way way, int thread,
                     struct gloss_point *point) {
    size_t points = gloss_points_of(l, segment);
    uint32_t texels = l->texels.first[segment + 1] - l->texels.first[segment];
    const uint32_t *texel = &l->texels.texel[l->texels.first[segment]];
    size_t tries = TRIES * points, count = 0, step = choose_even_step(texels);
    for (size_t i = 0; i < tries && i < texels && count < points; i++)
        count += look_at_texel(l, texel[i * step % texels], way, &l->scratch[thread], &point[count]);
    return count;
}

void gloss_looker_init(struct gloss_looker *l, const struct reconstruction *r, const struct views *views,
                       const struct probes *probes, const struct light_field *field) {
    *l = (struct gloss_looker){.r = r, .views = views, .probes = probes, .field = field};
    l->scratch = mem_array((size_t)parallel_thread_count(r->pool), sizeof *l->scratch);
    by_segment_sort(&l->texels, &r->segments, &r->inverse);
    for (size_t i = 0; i < r->segments.count; i++)
        l->roots += sqrt((double)(l->texels.first[i + 1] - l->texels.first[i]));
}

void gloss_looker_release(struct gloss_looker *l) {
    by_segment_release(&l->texels);
    mem_free(l->scratch);
}
