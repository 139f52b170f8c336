/* light_point.c -- see light_point.h. */
#include "server/light/light_point.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/mem.h"
#include "server/light/light_priors.h"
#include "server/render/sampler.h"

#define SKY_RAYS 2048
#define KEY_SKY 37 /* keeps these random numbers apart from others of the texel */
/* A patch is a cube of this part of the square root of the room's surface: some .3 m. */
#define PATCH_PART 0.022f
#define PATCH_BITS 9 /* of a coordinate of a patch */

struct gathering {
    const struct survey *survey;
    const struct light_sky *sky;
    const struct fused *observed; /* or NULL */
    struct light_points *points;
};

static rgb observed_at(const struct gathering *g, uint32_t texel) {
    const struct reconstruction *r = g->survey->r;
    rgb own = g->observed ? survey_observed(g->survey, g->observed, texel) : rgb_gray(0.0f);
    return rgb_is_black(own) ? survey_observed(g->survey, &r->fused, texel) : own;
}

float light_patch_edge(const struct mesh *mesh) { return PATCH_PART * (float)sqrt(mesh_area(mesh)); }

uint32_t light_patch(const struct surface_point *at, vec3 least, float edge_m) {
    vec3 from = vec3_scale(vec3_sub(at->position, least), 1.0f / edge_m);
    const float along[3] = {from.x, from.y, from.z};
    uint32_t patch =
        (at->normal.x > 0.0f) | (uint32_t)(at->normal.y > 0.0f) << 1 | (uint32_t)(at->normal.z > 0.0f) << 2;
    for (int i = 0; i < 3; i++)
        patch = patch << PATCH_BITS | ((uint32_t)clampf(along[i], 0.0f, 511.0f));
    return patch;
}

static float part_along(float x, float least, float most) { return (x - least) / fmaxf(most - least, 1e-20f); }

size_t light_points_region(const struct light_points *p, vec3 place) {
    const float part[3] = {part_along(place.x, p->least.x, p->most.x), part_along(place.y, p->least.y, p->most.y),
                           part_along(place.z, p->least.z, p->most.z)};
    size_t region = 0;
    for (int i = 0; i < 3; i++)
        region = 4 * region + (size_t)clampf(4.0f * part[i], 0.0f, 3.0f);
    return region;
}

/* Moves light of unobserved surfaces from `known` to `unobserved`, by the rays of the last gathering again. */
static void separate_unobserved(const struct gathering *g, struct incident *in, struct light_point *p) {
    const struct reconstruction *r = g->survey->r;
    float light[LIGHT_REGIONS][3] = {{0}};
    rgb sum = rgb_gray(0.0f);
    for (size_t i = 0; i < SURVEY_RAYS; i++)
        in->ray[i] = (struct accel_ray){accel_offset(p->at.position, p->at.normal, in->direction[i]), 0.0f,
                                        in->direction[i], INFINITY};
    accel_intersect_many(r->world.accel, SURVEY_RAYS, in->ray, in->hit);
    for (size_t i = 0; i < SURVEY_RAYS; i++) {
        const struct accel_hit *hit = &in->hit[i];
        if (hit->triangle == ACCEL_NONE)
            continue;
        const struct world_triangle *t = &r->world.triangle[hit->triangle];
        size_t texel = incident_texel(&r->world, hit);
        bool is_front = vec3_dot(t->normal, in->direction[i]) < 0.0f;
        if (!is_front || r->fused.count[texel] > 0.0f || r->world.lights->area_density[t->segment] > 0.0f ||
            (g->survey->field.specular_only && g->survey->field.specular_only[t->segment]))
            continue;
        float matt = irradiance_matt(vec3_dot(in->direction[i], p->at.shading));
        rgb radiance = rgb_scale(rgb_from_half(g->survey->field.radiance[texel]), matt / SURVEY_RAYS);
        vec3 place = vec3_mad(in->ray[i].origin, hit->distance_m, in->direction[i]);
        float *of_region = light[light_points_region(g->points, place)];
        for (size_t c = 0; c < 3; c++)
            of_region[c] += (&radiance.r)[c];
        sum = rgb_add(sum, radiance);
    }
    if (rgb_is_black(sum))
        return;
    p->known = rgb_clamp(rgb_sub(p->known, sum), 0.0f, INFINITY);
    p->unobserved = mem_array(3 * LIGHT_REGIONS, sizeof *p->unobserved);
    memcpy(p->unobserved, light, sizeof light);
}

/* The part of the sky that is seen from a point: where a ray of the last gathering escaped many more are traced. */
static void look_at_sky(const struct gathering *g, struct incident *in, struct light_point *p, uint32_t key) {
    const struct accel *accel = g->survey->r->world.accel;
    float cell[LIGHT_CELLS] = {0};
    bool escapes = false;
    for (size_t i = 0; i < SURVEY_RAYS; i++)
        escapes = escapes || in->escapes[i];
    if (!escapes)
        return;
    incident_cosine_rays(&p->at, key, SKY_RAYS, in->shadow);
    accel_occluded_many(accel, SKY_RAYS, in->shadow, in->occluded);
    for (size_t i = 0; i < SKY_RAYS; i++) {
        vec3 d = in->shadow[i].direction;
        if (!in->occluded[i] && vec3_dot(d, p->at.normal) > 0.0f)
            light_sky_add_ray(g->sky, p->at.position, d, irradiance_matt(vec3_dot(d, p->at.shading)) / SKY_RAYS, cell,
                              p->saturated);
    }
    for (size_t k = 0; k < LIGHT_CELLS; k++)
        p->escaping += cell[k];
    if (p->escaping > 0.0f) {
        p->sky = mem_array(LIGHT_CELLS, sizeof *p->sky);
        memcpy(p->sky, cell, sizeof cell);
    }
}

static void gather_point(void *user, size_t index, int thread) {
    const struct gathering *g = user;
    const struct reconstruction *r = g->survey->r;
    struct incident *in = &g->survey->scratch[thread];
    struct light_point *p = &g->points->point[index];
    uint32_t texel = g->survey->texel[index];
    struct irradiance light;
    *p = (struct light_point){.segment = reconstruction_segment(r, texel), .is_bound = r->fused.is_bound[texel]};
    p->is_lamp = g->survey->field.specular_only && g->survey->field.specular_only[p->segment];
    p->observed = p->is_bound ? fused_radiance(&r->fused, texel) : observed_at(g, texel);
    if (!survey_gather(g->survey, texel, SURVEY_RAYS, thread, &p->at, &light))
        return;
    p->patch = light_patch(&p->at, g->points->least, g->points->edge_m);
    p->known = survey_lambert(&p->at, &light);
    look_at_sky(g, in, p, sampler_key(KEY_SKY, texel, 0));
    float all = light.moment[0][0] + light.moment[0][1] + light.moment[0][2];
    if (!(all > 0.0f))
        return; /* also inside closed bodies, where the directions in `in` are those of another point */
    separate_unobserved(g, in, p);
    p->deviation = 3.0f * rgb_mean(light.noise) / all; /* one draw of it */
}

static int by_patch(const void *a, const void *b) {
    const struct light_point *first = a, *second = b;
    if (first->segment != second->segment)
        return first->segment < second->segment ? -1 : 1;
    if (first->patch != second->patch)
        return first->patch < second->patch ? -1 : 1;
    return (first->at.triangle > second->at.triangle) - (first->at.triangle < second->at.triangle);
}

/* Replaces an array of each of the points by their mean; where all have none they keep none. */
static void average_arrays(struct light_point *p, size_t count, size_t length,
                           float **(*array_of)(struct light_point *)) {
    double *sum = mem_calloc(length, sizeof *sum);
    bool any = false;
    for (size_t i = 0; i < count; i++) {
        const float *own = *array_of(&p[i]);
        any = any || own;
        for (size_t k = 0; k < length && own; k++)
            sum[k] += (double)own[k] / (double)count;
    }
    for (size_t i = 0; i < count && any; i++) {
        float **own = array_of(&p[i]);
        *own = *own ? *own : mem_array(length, sizeof **own);
        for (size_t k = 0; k < length; k++)
            (*own)[k] = (float)sum[k];
    }
    mem_free(sum);
}

static float **sky_of(struct light_point *p) { return &p->sky; }
static float **unobserved_of(struct light_point *p) { return &p->unobserved; }

/* What the rays of a patch's points found, averaged: few of a point's rays find a window, and noise of a response would
 * make its source too faint (regression dilution). */
static void average_patch(struct light_point *p, size_t count) {
    double escaping = 0.0, saturated[ENVIRONMENT_HALVES] = {0.0};
    for (size_t i = 0; i < count; i++) {
        escaping += (double)p[i].escaping / (double)count;
        for (size_t half = 0; half < ENVIRONMENT_HALVES; half++)
            saturated[half] += (double)p[i].saturated[half] / (double)count;
    }
    for (size_t i = 0; i < count; i++) {
        p[i].escaping = (float)escaping;
        for (size_t half = 0; half < ENVIRONMENT_HALVES; half++)
            p[i].saturated[half] = (float)saturated[half];
    }
    average_arrays(p, count, LIGHT_CELLS, sky_of);
    average_arrays(p, count, 3 * LIGHT_REGIONS, unobserved_of);
}

/* The deviation of a patch's points: the root mean square of their draws, and of light that is not modelled. */
static void find_deviations(struct light_points *p, float median_radiance) {
    for (size_t first = 0, end; first < p->count; first = end) {
        double squares = 0.0;
        for (end = first; end < p->count && p->point[end].patch == p->point[first].patch &&
                          p->point[end].segment == p->point[first].segment;
             end++)
            squares += (double)(p->point[end].deviation * p->point[end].deviation);
        average_patch(p->point + first, end - first);
        for (size_t i = first; i < end; i++) {
            float dark = DARK_DEVIATION * median_radiance / fmaxf(rgb_mean(p->point[i].observed), 1e-20f);
            p->point[i].deviation = sqrtf((float)(squares / (double)(end - first)) + dark * dark);
        }
    }
}

void light_points_init(struct light_points *p, const struct survey *survey, const struct light_sky *sky,
                       const struct fused *observed, float median_radiance) {
    const struct mesh *mesh = &survey->r->scene->mesh;
    struct gathering g = {survey, sky, observed, p};
    *p = (struct light_points){.count = survey->count, .point = mem_array(survey->count + 1, sizeof *p->point)};
    p->edge_m = light_patch_edge(mesh);
    mesh_bounds(mesh, &p->least, &p->most);
    parallel_for(survey->r->pool, survey->count, gather_point, &g);
    qsort(p->point, p->count, sizeof *p->point, by_patch);
    float dark = fmaxf(SURVEY_DARK * median_radiance, 1e-20f);
    for (size_t i = 0; i < p->count; i++) {
        p->point[i].observed = rgb_add(p->point[i].observed, rgb_gray(dark));
        p->point[i].known = rgb_add(p->point[i].known, rgb_gray(dark));
    }
    find_deviations(p, median_radiance);
}

void light_points_release(struct light_points *p) {
    for (size_t i = 0; i < p->count; i++)
        mem_free(p->point[i].sky), mem_free(p->point[i].unobserved);
    mem_free(p->point);
    *p = (struct light_points){0};
}
