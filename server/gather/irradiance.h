/* irradiance.h -- all light that arrives at a point of the surface, as its diffuse lobe needs it.
 *
 * Integrates over cosine-distributed rays and light samples (incident.h decides what rays find and how they continue);
 * interpolation between points is probes.h's. */
#ifndef UNBAKE_GATHER_IRRADIANCE_H
#define UNBAKE_GATHER_IRRADIANCE_H

#include <stddef.h>
#include <stdint.h>

#include "server/gather/incident.h"

/* Moments of the incident radiance L over the hemisphere of the shading normal, with c the cosine to it and F = (1 -
 * c)^5: integrals of L c, L c w, L c F, L c F w and L c F w w^T (xx yy zz xy xz yz) by solid angle, for each channel.
 * Disney diffuse is a polynomial in w . wo and F, so these give the diffusely reflected radiance for any viewer and any
 * roughness exactly. */
#define IRRADIANCE_MOMENTS 14
struct irradiance {
    float moment[IRRADIANCE_MOMENTS][3];
    rgb noise; /* a draw of the error of moment[0]: half the difference of the two halves of the samples */
};

/* Gathers from `samples` cosine-distributed directions and half as many light samples. Zero inside closed bodies, where
 * every ray meets a back. */
void irradiance_gather(struct irradiance *irradiance, struct incident *scratch, const struct light_field *field,
                       const struct surface_point *at, uint32_t key, size_t samples);

/* Adds light from one unit direction; `flux` is its irradiance on a surface that faces it. */
void irradiance_add(struct irradiance *irradiance, vec3 shading, vec3 direction, rgb flux);

/* The irradiance itself, the integral of L c. */
static inline rgb irradiance_flux(const struct irradiance *irradiance) {
    const float *sum = irradiance->moment[0];
    return rgb_make(sum[0], sum[1], sum[2]);
}

/* Radiance that the diffuse lobe with base colour 1 reflects towards unit `wo`. */
rgb irradiance_diffuse(const struct irradiance *irradiance, vec3 shading, float roughness, vec3 wo);

/* The same towards the normal, at roughness 1, of light at a cosine to it, over what a Lambertian surface would send:
 * more where light grazes the surface, 1.5 at most. */
float irradiance_matt(float cosine);

/* Its cosine-weighted mean over view directions: radiosity over pi. */
rgb irradiance_diffuse_mean(const struct irradiance *irradiance, vec3 shading, float roughness);

#endif
