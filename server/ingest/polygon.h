/* polygon.h -- cutting a planar or nearly planar polygon into triangles. */
#ifndef UNBAKE_INGEST_POLYGON_H
#define UNBAKE_INGEST_POLYGON_H

#include <stddef.h>
#include <stdint.h>

#include "common/vec.h"

#define POLYGON_MAX_CORNERS 1024 /* ear clipping takes time in the cube of it, at worst */

/* Cuts the polygon corner[count], 3 <= count <= POLYGON_MAX_CORNERS, into count - 2 triangles of
 * the same orientation: triangle[count - 2] gets positions within `corner`. A convex polygon is
 * a fan from its first corner (a quad: 012, 023), a concave one has its ears clipped. A polygon
 * that crosses itself still gives count - 2 triangles, some of them overlapping. */
void polygon_triangulate(const vec3 *corner, size_t count, uint32_t (*triangle)[3]);

#endif
