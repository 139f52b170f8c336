/* segment_color.h -- what in a segment of a scan has another colour: a frame around its mirror, a shelf before a wall.
 *
 * A scan rounds the step between things of some centimetres, so that they are one smooth surface; photographs still
 * show where one ends. Light changes along a surface slowly and in brightness, a border of two things in a step and
 * mostly in colour as well. Triangles of a segment are joined by what they show (Felzenszwalb & Huttenlocher 2004, with
 * areas for sizes); two parts stay apart where, some triangles from their border, they differ by more than either
 * varies. Pieces of a segment that meet nowhere, such as a wall's on both sides of what stands before it, stay one. */
#ifndef UNBAKE_SCENE_SEGMENT_COLOR_H
#define UNBAKE_SCENE_SEGMENT_COLOR_H

#include <stddef.h>
#include <stdint.h>

#include "server/scene/adjacency.h"

/* of_triangle[triangle_count] in [0, count). shown[triangle_count]: radiance; negative red: not known. Makes parts of
 * at least least_area (m^2) segments of their own, numbered from `count` on; in each piece of a segment the largest
 * keeps its number. Returns how many there are then. */
size_t segment_color_split(uint32_t *of_triangle, size_t count, const struct mesh *mesh,
                           const struct adjacency *adjacency, const rgb *shown, double least_area);

#endif
