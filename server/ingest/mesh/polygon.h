/* polygon.h -- triangulates planar or nearly planar polygons. */
#ifndef UNBAKE_INGEST_MESH_POLYGON_H
#define UNBAKE_INGEST_MESH_POLYGON_H

#include <stddef.h>
#include <stdint.h>

#include "common/vec.h"

#define POLYGON_MAX_CORNERS 1024 /* worst-case time of ear clipping is cubic */

/* Triangulates corner[count], 3 <= count <= POLYGON_MAX_CORNERS, keeping the orientation: triangle[count - 2]
 * receives indices into `corner`. Convex polygons become a fan from the first corner (a quad: 012, 023), concave ones
 * are ear-clipped. A self-intersecting polygon gives count - 2 triangles, some overlapping. */
void polygon_triangulate(const vec3 *corner, size_t count, uint32_t (*triangle)[3]);

#endif
