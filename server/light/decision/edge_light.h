/* edge_light.h -- light that arrives around the edges of a scan.
 *
 * A fused scan rounds edges over some centimetres and puts thin things, such as a window's bars, a little beside where
 * they are. What photographs show on one side of an edge may then be the other side: of a bar between two panes the
 * side that the sky lights, several times brighter than its front. Says how much brighter; decides nothing
 * (reflection.h). */
#ifndef UNBAKE_LIGHT_DECISION_EDGE_LIGHT_H
#define UNBAKE_LIGHT_DECISION_EDGE_LIGHT_H

#include "server/material/divide.h"
#include "server/state/reconstruction.h"

/* Lambert radiance around the brightest edge within reach of a texel over that at the texel: the median of the brighter
 * of texel[count], all of one segment. 1 where no edge is within reach, and on meshes whose noise is not known
 * (r->mesh_noise_m). `thread` picks of d->scratch. */
float edge_light(const struct reconstruction *r, const struct divide *d, const uint32_t *texel, size_t count,
                 int thread);

#endif
