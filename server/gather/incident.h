/* incident.h -- light that arrives at a point of the surface, looked up in the observed radiance.
 *
 * A ray from the point meets another surface whose exitant radiance was photographed: no path needs to be continued and
 * no material need be known (Wu et al. 2023, Li et al. 2023). Exitant radiance is assumed to be the same in all
 * directions, on polished surfaces without the specular part: there the ray is continued by the specular lobe, once
 * that is known, and a light is sampled, for which the lobe is widened. A ray is also continued from the back of a
 * surface, which no photograph shows (a wall without thickness has one), with the front's base colour. Emitters and the
 * environment are sampled as lights as well; both samplers are combined by the balance heuristic (Veach 1997). */
#ifndef UNBAKE_GATHER_INCIDENT_H
#define UNBAKE_GATHER_INCIDENT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/vec.h"
#include "server/render/world.h"
#include "server/scene/surface.h"

/* Directions that are traced at once, in scratch of one thread: 324 KiB, within a core's cache. */
#define INCIDENT_CHUNK 2048

/* The specular lobe of a segment; none where specular is 0. */
struct incident_lobe {
    float roughness, specular;
};

/* Where rays look up radiance. Emitters have `world->materials->emission`. */
struct light_field {
    const struct world *world;        /* borrowed, all */
    const uint16_t (*radiance)[3];    /* [atlas height][width] half precision: exitant radiance of texels */
    const struct incident_lobe *lobe; /* [segment_count] specular lobes, none of emitters; NULL: no reflections */
    const bool *specular_only;        /* [segment_count] black but to reflected rays; NULL: none */
};

/* Directions of arriving light at one point and what comes from there; scratch of one thread. */
struct incident {
    vec3 direction[INCIDENT_CHUNK]; /* unit, world */
    rgb radiance[INCIDENT_CHUNK];
    float light_pdf[INCIDENT_CHUNK]; /* density of the light sampler, by solid angle */
    bool escapes[INCIDENT_CHUNK];    /* the first ray meets no surface */
    struct accel_ray ray[INCIDENT_CHUNK];
    struct accel_hit hit[INCIDENT_CHUNK];
    struct incident_path {
        uint32_t index;     /* of the direction */
        rgb beta;           /* throughput */
        bool is_first;      /* the ray starts at the point itself */
        bool is_specular;   /* lights were sampled at its origin; emitters it meets count by the next two: */
        rgb light_beta;     /* throughput of the widened lobe, times pdf */
        float pdf;          /* density with which this direction was drawn */
    } path[INCIDENT_CHUNK]; /* of the current bounce's rays */
    struct incident_light_sample {
        uint32_t index;
        rgb radiance;
    } light_sample[INCIDENT_CHUNK];          /* lights to be reflected unless they are occluded */
    struct accel_ray shadow[INCIDENT_CHUNK]; /* towards them */
    uint8_t occluded[INCIDENT_CHUNK];
};

/* The texel that a ray hits. */
size_t incident_texel(const struct world *world, const struct accel_hit *hit);

/* Cosine-distributed direction about frame[2] (Malley's method), from u in [0, 1)^2. */
vec3 incident_cosine_direction(const vec3 frame[3], vec2 u);

/* Fills ray[count] with unbounded rays from a point in cosine-distributed directions about its shading normal. */
void incident_cosine_rays(const struct surface_point *at, uint32_t key, size_t count, struct accel_ray *ray);

/* Fills radiance, light_pdf and escapes for direction[0..count). Random numbers are those of `key`, samples
 * first_sample and up. */
void incident_trace(struct incident *in, const struct light_field *field, const struct surface_point *at, uint32_t key,
                    uint32_t first_sample, size_t count);

/* Appends `count` light samples after the first `from` entries of direction, radiance and light_pdf. Random numbers as
 * above. */
void incident_sample_lights(struct incident *in, const struct light_field *field, const struct surface_point *at,
                            uint32_t key, uint32_t first_sample, size_t from, size_t count);

#endif
