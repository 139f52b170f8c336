/* radiance_preview.h -- a first, coarse picture of the observed radiance, for display only.
 *
 * One texel of each square block, the plain mean of its observations, before exposures are solved; a fraction of the
 * work of fuse.h. */
#ifndef UNBAKE_CAPTURE_RADIANCE_PREVIEW_H
#define UNBAKE_CAPTURE_RADIANCE_PREVIEW_H

#include <stdint.h>

#include "server/capture/views.h"
#include "server/scene/atlas.h"
#include "server/scene/inverse_uv.h"

/* radiance[height][width], half precision, of valid texels; 0 where no photograph sees the block's texel. The caller's
 * (mem_free). */
uint16_t (*radiance_preview(const struct views *views, const struct atlas *atlas, const struct inverse_uv *inverse,
                            struct parallel *pool))[3];

#endif
