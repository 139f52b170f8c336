/* atlas_rectangle.h -- the smallest rectangle around points of a plane. */
#ifndef UNBAKE_SCENE_ATLAS_RECTANGLE_H
#define UNBAKE_SCENE_ATLAS_RECTANGLE_H

#include <stddef.h>

#include "common/vec.h"

/* The unit direction of a side of the rectangle of least area around point[count], count > 0; (1, 0)
 * where all points are one. Sorts the points; hull[count + 1] is scratch. */
vec2 atlas_rectangle(vec2 *point, size_t count, vec2 *hull);

#endif
