/* photograph_reduce.h -- a photograph at a whole fraction of its size, for comparing and looking.
 *
 * A photograph of 12 megapixels shows no more of where surfaces are, or of how well a room is recovered, than one of a
 * megapixel, and takes twelve times as long. What asks such questions of each pixel asks them of cells of some
 * pixels. */
#ifndef UNBAKE_SCENE_PHOTOGRAPH_REDUCE_H
#define UNBAKE_SCENE_PHOTOGRAPH_REDUCE_H

#include "server/scene/photograph.h"

/* Cells at the most: a photograph up to 1440 x 1080 has one a pixel. */
#define REDUCED_MAX_PIXELS 1600000.0

/* Pixels of a cell, in each direction: 1 or more, and at most the smaller side. */
uint32_t camera_step(const struct camera *camera);

/* The same for cells of which there are `most` at the most; 0: as many as pixels. */
uint32_t camera_step_to(const struct camera *camera, double most);

/* The camera whose pixels are `step` x `step` of this one's; columns and rows that fill no pixel are left out. `step`
 * is 1 or more, and at most the smaller side. */
struct camera camera_reduced(const struct camera *camera, uint32_t step);

/* Makes *out the photograph of that camera: each pixel is the mean of those it covers. It is excluded where one of
 * these is excluded or not finite, and where a channel is saturated in some of them only; it is saturated where all
 * are. *out has its arrays of `spill`, where room for pixels and twice a byte for each is reserved (NULL: memory), and
 * no name, fireflies and colour space; photograph_release. */
void photograph_reduce(const struct photograph *photo, uint32_t step, struct spill *spill, struct photograph *out);

#endif
