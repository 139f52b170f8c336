/* edge_light.c -- see edge_light.h. */
#include "server/light/decision/edge_light.h"

#include <math.h>

#include "common/quantile.h"
#include "server/gather/sun.h"
#include "server/light/decision/bright_texels.h"
#include "server/light/survey.h"
#include "server/render/bsdf.h"
#include "server/render/sampler.h"
#include "server/scene/surface.h"

#define PLACES 32        /* texels of a segment, of which the median is taken */
#define SIDES 8          /* directions in which an edge is looked for */
#define RAYS 128         /* by which light is gathered */
#define KEY_EDGE 0x3ed6u /* keeps these random numbers apart from others of the texel */

static float lambert_at(const struct divide *d, const struct surface_point *at, uint32_t key, int thread) {
    struct irradiance light;
    irradiance_gather(&light, &d->scratch[thread], d->field, at, key, RAYS);
    sun_add_light(d->sun, d->accel, at, &light);
    return rgb_mean(survey_lambert(at, &light));
}

/* Whether the surface ends within reach of a place in a direction along it; *beyond is a place there that faces that
 * way. */
static bool find_edge(const struct accel *accel, const struct surface_point *at, vec3 aside, float reach_m,
                      struct surface_point *beyond) {
    vec3 above = vec3_mad(at->position, 0.5f * reach_m, at->normal);
    if (accel_occluded(accel, above, aside, 0.0f, reach_m))
        return false; /* a corner of the room */
    above = vec3_mad(above, reach_m, aside);
    *beyond = *at;
    beyond->position = vec3_mad(at->position, reach_m, aside);
    beyond->normal = beyond->shading = aside;
    return !accel_occluded(accel, above, vec3_neg(at->normal), 0.0f, reach_m);
}

/* At one texel; 0 where nothing lights it. */
static float ratio_at(const struct reconstruction *r, const struct divide *d, uint32_t texel, int thread) {
    uint32_t key = sampler_key(KEY_EDGE, texel, 0);
    struct surface_point at, beyond;
    vec3 tangent, bitangent;
    if (!surface_at_texel(&r->scene->mesh, &r->atlas, &r->inverse, texel, &at))
        return 0.0f;
    float own = lambert_at(d, &at, key, thread), most = own;
    vec3_frame(at.normal, &tangent, &bitangent);
    for (int i = 0; i < SIDES; i++) {
        float around = 2.0f * BSDF_PI * (float)i / SIDES;
        vec3 aside = vec3_add(vec3_scale(tangent, cosf(around)), vec3_scale(bitangent, sinf(around)));
        if (find_edge(d->accel, &at, aside, reconstruction_edge_m(r), &beyond))
            most = fmaxf(most, lambert_at(d, &beyond, key, thread));
    }
    return own > 0.0f ? most / own : 0.0f;
}

float edge_light(const struct reconstruction *r, const struct divide *d, const uint32_t *texel, size_t count,
                 int thread) {
    uint32_t chosen[PLACES];
    float ratio[PLACES];
    size_t lit = 0;
    if (!(r->mesh_noise_m > 0.0f))
        return 1.0f;
    size_t chosen_count = bright_texels_choose(r, texel, count, PLACES, chosen);
    for (size_t i = 0; i < chosen_count; i++) {
        float here = ratio_at(r, d, chosen[i], thread);
        if (here > 0.0f)
            ratio[lit++] = here;
    }
    return lit > 0 ? quantile(ratio, lit, 0.5) : 1.0f;
}
