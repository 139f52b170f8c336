/* highlight.h -- radiance that the specular lobe of a surface reflects towards a viewer.
 *
 * One set of rays serves many materials: directions are drawn from the visible normals of every roughness level asked
 * for and from the lights, and weighted by the density of that mixture (balance heuristic, Veach 1997). */
#ifndef UNBAKE_GATHER_HIGHLIGHT_H
#define UNBAKE_GATHER_HIGHLIGHT_H

#include <stddef.h>
#include <stdint.h>

#include "server/gather/incident.h"

/* Levels evaluated at once, at most; every highlight costs time and memory for all. Roughness in steps
 * of a twelfth; specular as specular_fit.c has its levels. */
#define HIGHLIGHT_ROUGHNESSES 12 /* +25 %: -0.06 dB, specular +0.29 */
#define HIGHLIGHT_SPECULARS 5

/* The materials to evaluate: every pair of a roughness and a specular, both above 0. */
struct highlight_levels {
    size_t roughness_count, specular_count;
    float roughness[HIGHLIGHT_ROUGHNESSES];
    float specular[HIGHLIGHT_SPECULARS];
};

struct highlight {
    rgb radiance[HIGHLIGHT_ROUGHNESSES][HIGHLIGHT_SPECULARS];
};

/* Gathers the reflected radiance towards unit `wo` from `samples` directions of the lobes, divided among the roughness
 * levels, and `light_samples` of the lights; together at most INCIDENT_CHUNK. */
void highlight_gather(struct highlight *highlight, struct incident *scratch, const struct light_field *field,
                      const struct surface_point *at, vec3 wo, const struct highlight_levels *levels, uint32_t key,
                      size_t samples, size_t light_samples);

/* Hemispherical-hemispherical albedo of the lobe under uniform illumination. */
float highlight_albedo(float roughness, float specular);

#endif
