/* edge_light.h -- light of what lies around an edge of a scan.
 *
 * A fused scan rounds edges over some centimetres and puts thin things, such as a window's bars, a little beside where
 * they are. What photographs show on one side of an edge may be the other side then: of a bar between two panes the side
 * that the sky lights, dozens of times brighter than its front. */
#ifndef UNBAKE_LIGHT_DECISION_EDGE_LIGHT_H
#define UNBAKE_LIGHT_DECISION_EDGE_LIGHT_H

#include "server/material/divide.h"
#include "server/state/reconstruction.h"

/* How much more a surface of albedo 1 may send around the edges within reach of texel[count], all of one segment, than
 * there, by the median of the brighter of these; 1 where none is within reach, and on meshes whose noise is not known
 * (r->mesh_noise_m). `thread` picks of d->scratch. */
float edge_light(const struct reconstruction *r, const struct divide *d, const uint32_t *texel, size_t count,
                 int thread);

#endif
