/* sun_shadows.h -- how much of the sun each texel sees, and how much photographs see of its light there.
 *
 * A pixel averages its footprint, so what photographs show of a shadow's edge is blurred. Base colour read from there
 * with the texel's own light would be bright on one side of the edge and dark on the other; so the sun's light is
 * averaged over the footprint as well. */
#ifndef UNBAKE_MATERIAL_SUN_SHADOWS_H
#define UNBAKE_MATERIAL_SUN_SHADOWS_H

#include <stdbool.h>
#include <stdint.h>

#include "common/parallel.h"
#include "server/gather/sun.h"
#include "server/material/footprint.h"
#include "server/scene/surface.h"

struct sun_shadows {
    struct surface surface; /* borrowed */
    uint8_t *visible;       /* [height][width] visible fraction of the disc, in 255ths; NULL: there is no sun; owned */
    bool *is_mixed;         /* [tiles down][tiles across] there are edges of shadows in the tile or beside it; owned */
    uint32_t tiles_across;
};

/* Of all valid texels; nothing where there is no sun. */
void sun_shadows_init(struct sun_shadows *s, const struct surface *surface, const struct sun *sun,
                      const struct accel *accel, struct parallel *pool);
void sun_shadows_release(struct sun_shadows *s);

/* Visible fraction at a valid texel; 0 where there is no sun. */
float sun_shadows_at(const struct sun_shadows *s, uint32_t texel);

/* Whether photographs may see another fraction of it there. */
bool sun_shadows_blurs(const struct sun_shadows *s, uint32_t texel);

/* *seen: mean visible fraction, over texels of the same chart, in what a bilinear look-up at a valid texel averages, by
 * the footprint of a pixel there. False where no texel within two pixels each way, which a bicubic look-up reads, sees
 * another fraction. */
bool sun_shadows_seen(const struct sun_shadows *s, uint32_t texel, const struct footprint *pixel, float *seen);

#endif
