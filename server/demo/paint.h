/* paint.h -- base colours of the demo room as functions of position. */
#ifndef UNBAKE_DEMO_PAINT_H
#define UNBAKE_DEMO_PAINT_H

#include "common/vec.h"
#include "server/demo/objects.h"

/* Linear base colour of an object at a point of its surface; `normal` is the geometric one. */
rgb paint_base_color(enum room_object object, vec3 point, vec3 normal);

#endif
