/* photograph_reduce.h -- a photograph at a whole fraction of its size, for comparing and looking. */
#ifndef UNBAKE_SCENE_PHOTOGRAPH_REDUCE_H
#define UNBAKE_SCENE_PHOTOGRAPH_REDUCE_H

#include "server/scene/photograph.h"

/* The camera whose pixels are `step` x `step` of this one's; columns and rows that fill no pixel are left out. `step` is
 * 1 or more, and at most the smaller side. */
struct camera camera_reduced(const struct camera *camera, uint32_t step);

/* Makes *out the photograph of that camera: each pixel is the mean of those it covers. It is excluded where one of these
 * is excluded or not finite, and where a channel is saturated in some of them only; it is saturated where all are.
 * *out is in memory, without name, fireflies and colour space; photograph_release. */
void photograph_reduce(const struct photograph *photo, uint32_t step, struct photograph *out);

#endif
