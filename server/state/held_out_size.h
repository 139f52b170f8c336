/* held_out_size.h -- the size at which held-out views are rendered and compared.
 *
 * A photograph of 12 megapixels shows nothing of how well a room is recovered that one of a megapixel does not, and takes
 * twelve times as long to render: its view is compared at a whole fraction of its size. */
#ifndef UNBAKE_STATE_HELD_OUT_SIZE_H
#define UNBAKE_STATE_HELD_OUT_SIZE_H

#include "server/scene/scene.h"

/* Pixels of a view at the most: a photograph up to 1440 x 1080 keeps its size. */
#define HELD_OUT_MAX_PIXELS 1600000.0

/* Pixels of the photograph, in each direction, for one of the view; 1 or more. */
uint32_t held_out_step(const struct camera *camera);

/* Pixels of the views of all held-out photographs, or of all photographs. */
double held_out_pixels(const struct scene *scene);
double held_out_pixels_of_all(const struct scene *scene);

#endif
