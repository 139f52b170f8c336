/* fuse.h -- the measured light: what the photographs show of each texel, taken together.
 *
 * The mean of all clean look-ups, weighted by the solid angle that a patch of the surface fills in
 * the photograph, by its noise, and by how well a look-up agrees with the others: a highlight that
 * one photograph has caught, or a pose that is off, counts little. Of a few hundred the best are taken, by their weights
 * before brightness is known; all are counted. A saturated value is a lower bound: it is left
 * out where others measured, and stands in where none did. Held-out photographs are never asked. */
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
    uint16_t (*radiance)[3]; /* [height][width] half precision; 0 where nothing was seen; owned */
    float *count;            /* [height][width] photographs that see the texel cleanly; owned */
    float *spread;           /* [height][width] standard deviation of the logarithm of what they show; owned */
    bool *is_bound;          /* [height][width] all of them saturate there: radiance is a lower bound; owned */
};

void fuse(struct fused *f, const struct views *views, const struct noise *noise, const struct atlas *atlas,
          const struct inverse_uv *inverse, struct parallel *pool);
void fused_release(struct fused *f);

static inline rgb fused_radiance(const struct fused *f, uint32_t texel) {
    return rgb_from_half(f->radiance[texel]);
}

/* The mean of those texels of its chart at most `around` texels away each way that photographs measured, by their
 * count: of one texel alone noise may be a third. 0 where there are none. */
rgb fused_around(const struct fused *f, const struct atlas *atlas, const struct inverse_uv *inverse, uint32_t texel,
                 uint32_t around);

#endif
