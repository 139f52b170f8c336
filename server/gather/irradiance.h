/* irradiance.h -- all light that arrives at a point of the surface, as its diffuse lobe needs it.
 *
 * Sums over what rays find (incident.h), which it draws about the normal; what surfaces send out and where rays go on is
 * decided there, and what is between such points in probes.h. */
#ifndef UNBAKE_GATHER_IRRADIANCE_H
#define UNBAKE_GATHER_IRRADIANCE_H

#include <stddef.h>
#include <stdint.h>

#include "server/gather/incident.h"

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
