/* estimate.h -- memory and time that a job on a scene will take.
 *
 * Memory is a sum of what grows with the photographs' pixels, with triangles and with texels. It was measured on rooms
 * of .06 to 6 million pixels, 12 to 400,000 triangles and 256 to 2048 texels a side, where it is right within a
 * quarter; beyond them it is taken to grow on. Time is the first forecast of a job (state/pace.h), which is right
 * within a factor of two on machines like the one that it was measured on. */
#ifndef UNBAKE_CHECK_ESTIMATE_H
#define UNBAKE_CHECK_ESTIMATE_H

#include "common/parallel.h"
#include "common/settings.h"
#include "server/scene/scene.h"

#define ESTIMATE_TEXEL_BYTES 102.0 /* a texel of the square, of the memory below */

/* Bytes at the peak, with textures of `side` texels a side and at most `kept` pixels of a photograph
 * (common/kept_pixels.h; 0: all). Pixels beyond the budget of the scene's spill lie on the disk. */
double estimate_memory_bytes(const struct scene *scene, double kept, double side);

/* Seconds with as many threads as the pool has; that of time_limit_sec where it is set and less. */
double estimate_time_sec(const struct scene *scene, const struct settings *settings, struct parallel *pool);

#endif
