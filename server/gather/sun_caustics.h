/* sun_caustics.h -- sunlight that polished surfaces throw onto others.
 *
 * Rays from probes go on from polished surfaces (incident.h), but the sun is so small that hardly one would meet it. So
 * that light is followed from the sun: rays from each polished texel that it reaches, by the specular lobe, and what they
 * bring is shared out over the piece of surface that a probe stands for (photons: Jensen 1996, with the probes' blocks
 * for bins). Lamps and sky are left to those other rays. */
#ifndef UNBAKE_GATHER_SUN_CAUSTICS_H
#define UNBAKE_GATHER_SUN_CAUSTICS_H

#include <stdbool.h>
#include <stdint.h>

#include "common/parallel.h"
#include "server/gather/probes.h"
#include "server/gather/sun.h"
#include "server/render/world.h"
#include "server/scene/inverse_uv.h"
#include "server/scene/materials.h"
#include "server/scene/mesh.h"

/* Adds it to the light at all probes, by roughness and specular of polished segments as world->materials has them.
 * Returns the share that it is of all light that arrives at the surface. The same for any number of threads. */
double sun_caustics_add(struct probes *probes, const struct sun *sun, const struct world *world,
                        const struct mesh *mesh, const struct inverse_uv *inverse, uint64_t seed,
                        struct parallel *pool);

#endif
