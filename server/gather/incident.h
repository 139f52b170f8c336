/* incident.h -- the light that arrives at a point of the surface, read off what was measured.
 *
 * A ray that leaves the point meets another surface, and what that surface sends back was
 * photographed: no path needs to go on, and no material need be known (Wu et al. 2023, Li et
 * al. 2023). Surfaces are taken to send the same in all directions, polished ones without what they
 * mirror: from there the ray goes on by the specular lobe, once it is known, and a light is sampled,
 * for which the lobe is widened. A ray goes on from the back of a surface, too, which is in no photograph (a wall without thickness has one): it has the front's base
 * colour. Light from emitters and from the environment is sampled as such as well; the two ways are
 * combined by the balance heuristic (Veach 1997). */
#ifndef UNBAKE_GATHER_INCIDENT_H
#define UNBAKE_GATHER_INCIDENT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/vec.h"
#include "server/render/world.h"
#include "server/scene/surface.h"

#define INCIDENT_CHUNK 2048 /* directions at once */

/* The specular lobe of a segment; none where specular is 0. */
struct incident_lobe {
    float roughness, specular;
};

/* What light rays find. Emitters show `world->materials->emission`, constant over a segment. */
struct light_field {
    const struct world *world;        /* borrowed, all */
    const uint16_t (*radiance)[3];    /* [atlas height][width] half precision: what texels send out */
    const struct incident_lobe *lobe; /* [segment_count] by which they mirror besides, emitters not; NULL: none does */
    const bool *specular_only;        /* [segment_count] black but to those who see them in a mirror; NULL: none */
};

/* Directions of arriving light at one point and what comes from there; scratch of one thread. */
struct incident {
    vec3 direction[INCIDENT_CHUNK]; /* unit, world */
    rgb radiance[INCIDENT_CHUNK];
    float light_pdf[INCIDENT_CHUNK]; /* by solid angle, with which the light sampler picks it */
    bool escapes[INCIDENT_CHUNK];     /* it meets no surface */
    struct accel_ray ray[INCIDENT_CHUNK];
    struct accel_hit hit[INCIDENT_CHUNK];
    struct incident_path {
        uint32_t index;   /* of the direction */
        rgb beta;         /* of what is found on it */
        bool is_first;    /* straight from the point */
        bool is_specular; /* lights were sampled as such there; these count as follows: */
        rgb light_beta;   /* times the density: */
        float pdf;    /* with which this direction was drawn */
    } path[INCIDENT_CHUNK]; /* of the rays under way */
    struct incident_light_sample {
        uint32_t index;
        rgb radiance;
    } light_sample[INCIDENT_CHUNK]; /* lights that are mirrored unless they are occluded */
    struct accel_ray shadow[INCIDENT_CHUNK]; /* towards them */
    uint8_t occluded[INCIDENT_CHUNK];
};

/* A direction about frame[2], distributed by its cosine, from u in [0, 1)^2. */
vec3 incident_cosine_direction(const vec3 frame[3], vec2 u);

/* Fills radiance, light_pdf and leaves for direction[0..count), whose random numbers are those of `key`, samples
 * first_sample and up. */
void incident_trace(struct incident *in, const struct light_field *field,
                    const struct surface_point *at, uint32_t key, uint32_t first_sample, size_t count);

/* Appends `count` samples of the lights behind the `from` that are there: all three arrays. The
 * numbers are those of `key`, samples first_sample and up. */
void incident_sample_lights(struct incident *in, const struct light_field *field,
                            const struct surface_point *at, uint32_t key, uint32_t first_sample,
                            size_t from, size_t count);

#endif
