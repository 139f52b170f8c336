/* sky_doubt.c -- see sky_doubt.h. */
#include "server/light/decision/sky_doubt.h"

#include <math.h>

#include "server/gather/incident.h"
#include "server/light/decision/bright_texels.h"
#include "server/render/sampler.h"
#include "server/scene/surface.h"

#define PLACES 64 /* and rays of each */
#define KEY_DOUBT 0x5d0b7u

/* Cosine-weighted mean radiance from unobserved sky at a place. */
static float unseen_light_at(const struct reconstruction *r, uint32_t texel) {
    struct surface_point at;
    if (!surface_at_texel(&r->scene->mesh, &r->atlas, &r->inverse, texel, &at))
        return 0.0f;
    struct accel_ray ray[PLACES];
    float sum = 0.0f;
    incident_cosine_rays(&at, sampler_key(KEY_DOUBT, texel, 0), PLACES, ray);
    for (size_t i = 0; i < PLACES; i++) {
        vec3 d = ray[i].direction;
        if (vec3_dot(d, at.normal) > 0.0f && !environment_is_seen(&r->environment, d) &&
            !accel_occluded(r->world.accel, ray[i].origin, d, 0.0f, INFINITY))
            sum += rgb_mean(lights_environment(r->world.lights, d));
    }
    return sum / PLACES;
}

float sky_doubt(const struct reconstruction *r, const uint32_t *texel, size_t count) {
    uint32_t chosen[PLACES];
    float sum = 0.0f;
    if (!r->environment.map.pixel)
        return 0.0f;
    size_t chosen_count = bright_texels_choose(r, texel, count, PLACES, chosen);
    for (size_t i = 0; i < chosen_count; i++)
        sum += unseen_light_at(r, chosen[i]);
    return chosen_count > 0 ? sum / (float)chosen_count : 0.0f;
}
