/* highlight.h -- what the specular lobe of a surface sends towards a viewer.
 *
 * One set of rays serves many materials: directions are drawn from the visible normals of all
 * roughness levels asked for and from the lights, and weighted by the density of that mixture
 * (balance heuristic, Veach 1997), so that one set of rays tells the lobe of every level. */
#ifndef UNBAKE_GATHER_HIGHLIGHT_H
#define UNBAKE_GATHER_HIGHLIGHT_H

#include <stddef.h>
#include <stdint.h>

#include "server/gather/incident.h"

#define HIGHLIGHT_ROUGHNESSES 12
#define HIGHLIGHT_SPECULARS 5

/* The materials to evaluate: all pairs of a roughness and a specular above 0. */
struct highlight_levels {
    size_t roughness_count, specular_count;
    float roughness[HIGHLIGHT_ROUGHNESSES];
    float specular[HIGHLIGHT_SPECULARS];
};

struct highlight {
    rgb radiance[HIGHLIGHT_ROUGHNESSES][HIGHLIGHT_SPECULARS];
};

/* Gathers what the lobes send towards unit `wo` from `samples` directions of their own, spread over
 * the roughness levels, and `light_samples` of the lights; together at most INCIDENT_CHUNK. */
void highlight_gather(struct highlight *highlight, struct incident *scratch,
                      const struct light_field *field, const struct surface_point *at, vec3 wo,
                      const struct highlight_levels *levels, uint32_t key, size_t samples,
                      size_t light_samples);

/* The part that the lobe sends back of light that arrives evenly from everywhere. */
float highlight_albedo(float roughness, float specular);

#endif
