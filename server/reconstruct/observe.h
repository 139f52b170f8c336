/* observe.h -- what the photographs show of each texel, taken together.
 *
 * The geometric mean of all clean, unsaturated look-ups, weighted by the solid angle that a patch
 * of the surface fills in the photograph: a highlight in one of them hardly moves it. It holds
 * the surface's detail times its light; the detail is what the coarse levels of the optimiser
 * keep (listing1.h). Held-out photographs are never asked. */
#ifndef UNBAKE_RECONSTRUCT_OBSERVE_H
#define UNBAKE_RECONSTRUCT_OBSERVE_H

#include <stddef.h>
#include <stdint.h>

#include "server/reconstruct/views.h"
#include "server/scene/atlas.h"
#include "server/scene/inverse_uv.h"

struct observed {
    uint32_t width, height;
    uint16_t (*radiance)[3]; /* [height][width] half precision; 0 where nothing was seen; owned */
    float *count;            /* [height][width] photographs that see the texel; owned */
    float *spread;           /* [height][width] standard deviation of the logarithm of what they show; owned */
};

void observed_make(struct observed *o, const struct views *views, const struct atlas *atlas,
                   const struct inverse_uv *inverse, struct parallel *pool);
void observed_release(struct observed *o);

#endif
