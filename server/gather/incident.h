/* incident.h -- the light that arrives at a point of the surface, read off what was measured.
 *
 * A ray that leaves the point meets another surface, and what that surface sends back was
 * photographed: no path needs to go on, and no material need be known (Wu et al. 2023, Li et
 * al. 2023). Surfaces are taken to send the same in all directions here. The back of a surface is
 * in no photograph (a wall without thickness has one): it has the front's base colour, and the ray
 * goes on from there. Light from emitters and
 * from the environment is sampled as such as well; the two ways are combined by the balance
 * heuristic (Veach 1997). */
#ifndef UNBAKE_GATHER_INCIDENT_H
#define UNBAKE_GATHER_INCIDENT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/vec.h"
#include "server/render/world.h"
#include "server/scene/surface.h"

#define INCIDENT_CHUNK 2048 /* directions at once */

/* What light rays find. Emitters show `world->materials->emission`, constant over a segment. */
struct light_field {
    const struct world *world;     /* borrowed, all */
    const uint16_t (*radiance)[3]; /* [atlas height][width] half precision: what texels send out */
};

/* Directions of arriving light at one point and what comes from there; scratch of one thread. */
struct incident {
    vec3 direction[INCIDENT_CHUNK]; /* unit, world */
    rgb radiance[INCIDENT_CHUNK];
    float light_pdf[INCIDENT_CHUNK]; /* by solid angle, with which the light sampler picks it */
    bool leaves[INCIDENT_CHUNK];     /* it meets no surface */
    struct accel_ray ray[INCIDENT_CHUNK];
    struct accel_hit hit[INCIDENT_CHUNK];
    struct incident_back {
        uint32_t index; /* of the direction */
        rgb weight;     /* of what the ray that goes on finds */
    } back[INCIDENT_CHUNK]; /* directions in which a back was met */
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

/* Moments of the arriving light over the hemisphere of the shading normal, c its cosine and
 * F = (1 - c)^5: integrals of L c, L c w, L c F, L c F w and L c F w w^T (xx yy zz xy xz yz) by solid
 * angle, by channel. Disney diffuse is a polynomial in w . wo and F, so these tell what the diffuse
 * lobe sends to any viewer at any roughness, exactly. */
#define IRRADIANCE_MOMENTS 14
struct irradiance {
    float moment[IRRADIANCE_MOMENTS][3];
    rgb noise; /* a draw of the error of moment[0]: half the difference of what two halves of the samples tell */
};

/* Gathers from `samples` cosine-distributed directions and half as many light samples. Nothing arrives inside a body,
 * where every ray meets a back. */
void irradiance_gather(struct irradiance *irradiance, struct incident *scratch,
                       const struct light_field *field, const struct surface_point *at, uint32_t key,
                       size_t samples);

/* Adds light from one unit direction, of which so much would arrive at a surface that faced it (irradiance). */
void irradiance_add(struct irradiance *irradiance, vec3 shading, vec3 direction, rgb flux);

/* Radiance that the diffuse lobe of a white surface sends towards unit `wo`. */
rgb irradiance_diffuse(const struct irradiance *irradiance, vec3 shading, float roughness, vec3 wo);

/* Its mean over viewers, by the cosine of where they are: radiosity over pi. */
rgb irradiance_diffuse_mean(const struct irradiance *irradiance, vec3 shading, float roughness);

#endif
