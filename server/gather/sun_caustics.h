/* sun_caustics.h -- sunlight reflected by polished surfaces onto others, by photon tracing.
 *
 * Rays from probes continue from polished surfaces (incident.h), but the sun is so small that hardly one meets it. So
 * this light is traced from the sun: each sunlit polished texel emits photons by its specular lobe, which are binned
 * over the area that each probe stands for (photons: Jensen 1996). One reflection only. Lamps and sky are left to the
 * rays from probes. */
#ifndef UNBAKE_GATHER_SUN_CAUSTICS_H
#define UNBAKE_GATHER_SUN_CAUSTICS_H

#include <stdint.h>

#include "common/parallel.h"
#include "server/gather/probes.h"
#include "server/gather/sun.h"
#include "server/render/world.h"
#include "server/scene/inverse_uv.h"
#include "server/scene/materials.h"
#include "server/scene/mesh.h"

/* Adds it to the irradiance of all probes, with roughness and specular of polished segments from world->materials.
 * Returns its share of all light that arrives at the surface. The same for any number of threads. */
double sun_caustics_add(struct probes *probes, const struct sun *sun, const struct world *world,
                        const struct mesh *mesh, const struct inverse_uv *inverse, uint64_t seed,
                        struct parallel *pool);

#endif
