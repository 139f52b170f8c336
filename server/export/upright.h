/* upright.h -- the turn of the room whose upward axis becomes +y, for formats with a fixed one. */
#ifndef UNBAKE_EXPORT_UPRIGHT_H
#define UNBAKE_EXPORT_UPRIGHT_H

#include "common/vec.h"

/* Where the turn puts a point. `up` is an axis of the room or a negative one (scene_up); 0 is y. */
void upright_turn(vec3 up, const double point[3], double turned[3]);

/* The same turn as a unit quaternion x y z w. */
const float *upright_quaternion(vec3 up);

#endif
