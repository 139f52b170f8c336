/* sun_mirrored.h -- sunlight that polished surfaces throw onto others.
 *
 * The light at probes is read off what surfaces were seen to send, and these are taken to send the same in all
 * directions; a polished floor in the sun sends most in one, in which hardly a photograph looks. That light is followed
 * from the sun: rays from each texel that it reaches, by the specular lobe, and what they bring is shared out over the
 * piece of surface that a probe stands for (photons: Jensen 1996, with the probes' blocks for bins). */
#ifndef UNBAKE_GATHER_SUN_MIRRORED_H
#define UNBAKE_GATHER_SUN_MIRRORED_H

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
double sun_mirrored_add(struct probes *probes, const struct sun *sun, const struct world *world,
                        const struct mesh *mesh, const struct inverse_uv *inverse, uint64_t seed,
                        struct parallel *pool);

#endif
