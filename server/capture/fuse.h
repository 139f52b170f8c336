/* fuse.h -- the observed radiance of each texel, over all photographs.
 *
 * Robust weighted mean of all clean look-ups: by the solid angle of a surface patch in the photograph, by noise, and by
 * agreement with the others (a highlight in one photograph or a wrong pose counts little). Of several hundred
 * observations those of the greatest prior weight are used; all are counted. A saturated value is a lower bound: it is
 * left out where others measured, and used where none did. Held-out photographs take no part. */
#ifndef UNBAKE_CAPTURE_FUSE_H
#define UNBAKE_CAPTURE_FUSE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "server/capture/noise.h"
#include "server/capture/views.h"
#include "server/scene/atlas.h"
#include "server/scene/inverse_uv.h"
#include "server/scene/rgb_half.h"

struct fused {
    uint32_t width, height;
    uint16_t (*radiance)[3]; /* [height][width] half precision; 0 where unseen; owned */
    float *count;            /* [height][width] photographs that see the texel cleanly; owned */
    float *spread;           /* [height][width] standard deviation of log radiance among them; owned */
    bool *is_bound;          /* [height][width] all of them saturate there: radiance is a lower bound; owned */
};

void fuse(struct fused *f, const struct views *views, const struct noise *noise, const struct atlas *atlas,
          const struct inverse_uv *inverse, struct parallel *pool);
void fused_release(struct fused *f);

static inline rgb fused_radiance(const struct fused *f, uint32_t texel) { return rgb_from_half(f->radiance[texel]); }

/* Mean of the measured texels of the same chart at most `around` texels away in each axis, weighted by their count; 0
 * where there are none. A single texel may have a third of noise. */
rgb fused_around(const struct fused *f, const struct atlas *atlas, const struct inverse_uv *inverse, uint32_t texel,
                 uint32_t around);

#endif
