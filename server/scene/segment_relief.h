/* segment_relief.h -- what stands off the plane of a segment of a scan: a moulding, a panel, a picture on a wall.
 *
 * A scan rounds a step of some centimetres, so that what is fixed to a wall is one smooth surface with it. But the wall
 * is known to be flat, within the deviations of its own fit: a connected part that is off its plane by several of
 * these, and ends in steps, is another object. */
#ifndef UNBAKE_SCENE_SEGMENT_RELIEF_H
#define UNBAKE_SCENE_SEGMENT_RELIEF_H

#include <stddef.h>
#include <stdint.h>

#include "server/scene/adjacency.h"

/* of_triangle[triangle_count] in [0, count). Makes parts of at least least_area (m^2) segments of their own, numbered
 * from `count` on; returns how many there are then. */
size_t segment_relief_split(uint32_t *of_triangle, size_t count, const struct mesh *mesh,
                            const struct adjacency *adjacency, double least_area);

#endif
