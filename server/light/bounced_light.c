/* bounced_light.c -- see bounced_light.h. */
#include "server/light/bounced_light.h"

#include <math.h>

#include "server/gather/incident.h"
#include "server/render/bsdf.h"
#include "server/render/sampler.h"

/* Reflections of a particle: after eight of white paint a quarter is left, and most have left a gap by then. */
#define REFLECTIONS 8
#define PARTICLES (BOUNCED_MAX / REFLECTIONS)
#define KEY_PARTICLES 53 /* keeps these random numbers apart from others of the segment */

struct particle {
    struct accel_ray ray;
    float power;    /* in units of that of the whole segment */
    float square_m; /* sum of the squares of the lengths of its path */
};

struct tracing {
    const struct reconstruction *r;
    const float *albedo;
    float power; /* of the segment at radiance 1: pi times its area */
    size_t disc_count;
    struct segment_light_disc *disc; /* [BOUNCED_MAX] */
};

static struct accel_ray cosine_ray(const struct surface_point *at, uint32_t key, uint32_t index, uint32_t pair) {
    vec3 frame[3] = {[2] = at->normal};
    vec3_frame(frame[2], &frame[0], &frame[1]);
    vec3 direction = incident_cosine_direction(frame, sampler_pair(key, index, pair));
    return (struct accel_ray){accel_offset(at->position, at->normal, direction), 0.0f, direction, INFINITY};
}

/* Where a particle is reflected; false where it escapes or meets a surface that photographs show. */
static bool meet_unseen(const struct tracing *t, const struct accel_ray *ray, const struct accel_hit *hit,
                        struct surface_point *at) {
    if (hit->triangle == ACCEL_NONE)
        return false;
    const struct world_triangle *met = &t->r->world.triangle[hit->triangle];
    bool is_front = vec3_dot(met->normal, ray->direction) < 0.0f;
    if (is_front && t->r->fused.count[incident_texel(&t->r->world, hit)] > 0.0f)
        return false;
    vec3 normal = is_front ? met->normal : vec3_neg(met->normal);
    *at = (struct surface_point){.triangle = hit->triangle, .normal = normal, .shading = normal};
    at->position = vec3_mad(ray->origin, hit->distance_m, ray->direction);
    return true;
}

/* Reflects a particle: a disc as wide as particles are apart there sends what it brings. */
static bool reflect(struct tracing *t, struct particle *p, const struct accel_hit *hit, uint32_t key, uint32_t index,
                    uint32_t reflection) {
    struct surface_point at;
    if (!meet_unseen(t, &p->ray, hit, &at))
        return false;
    p->square_m += hit->distance_m * hit->distance_m;
    p->power *= t->albedo[t->r->world.triangle[hit->triangle].segment];
    float area_m2 = fmaxf(BSDF_PI * p->square_m / PARTICLES, 1e-20f);
    t->disc[t->disc_count++] = (struct segment_light_disc){at, area_m2, p->power * t->power / (BSDF_PI * area_m2)};
    p->ray = cosine_ray(&at, key, index, 1 + reflection);
    return true;
}

static void trace(struct tracing *t, const struct segment_light_disc *from, size_t count, uint32_t key) {
    struct particle particle[PARTICLES];
    bool flies[PARTICLES];
    for (uint32_t i = 0; i < count; i++) {
        particle[i] = (struct particle){cosine_ray(&from[i].at, key, i, 0), 1.0f / (float)count, 0.0f};
        flies[i] = true;
    }
    for (uint32_t k = 0; k < REFLECTIONS; k++) {
        for (uint32_t i = 0; i < count; i++) {
            struct accel_hit hit;
            if (!flies[i])
                continue;
            accel_intersect_many(t->r->world.accel, 1, &particle[i].ray, &hit);
            flies[i] = reflect(t, &particle[i], &hit, key, i, k);
        }
    }
}

size_t bounced_light_find(const struct segment_light *light, uint32_t segment, const float *albedo,
                          struct segment_light_disc disc[BOUNCED_MAX]) {
    struct tracing t = {light->r, albedo, BSDF_PI * light->area_m2[segment], 0, disc};
    struct segment_light_disc from[PARTICLES];
    trace(&t, from, segment_light_spread(light, segment, PARTICLES, from), sampler_key(KEY_PARTICLES, segment, 0));
    return t.disc_count;
}
