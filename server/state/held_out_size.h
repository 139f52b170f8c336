/* held_out_size.h -- how many pixels held-out views have, which are compared at the size of camera_step. */
#ifndef UNBAKE_STATE_HELD_OUT_SIZE_H
#define UNBAKE_STATE_HELD_OUT_SIZE_H

#include "server/scene/scene.h"

/* Pixels of the views of all held-out photographs, or of all photographs. */
double held_out_pixels(const struct scene *scene);
double held_out_pixels_of_all(const struct scene *scene);

#endif
