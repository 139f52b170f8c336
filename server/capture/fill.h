/* fill.h -- filling in a latitude-longitude map where nothing is known.
 *
 * What is far is alike around the horizon: sky above, ground below. Each row has the mean of what is known of it, a
 * row of which nothing is that of the nearest. What is known differs from that; the difference is spread by pull-push
 * (Gortler et al. 1996, The Lumigraph, section 3.4) by solid angle, around the seam, then by diffusion with the
 * sphere's metric: next to what is known the fill continues it, far from it it is the row's. Highlights do not
 * spread: a sun at the rim of a window would otherwise light half of the sky. */
#ifndef UNBAKE_CAPTURE_FILL_H
#define UNBAKE_CAPTURE_FILL_H

#include "common/image.h"

/* map: three channels, finite, not negative, of a power of two times half of it. Pixels whose first
 * channel in `known`, of the same size, is above 0 stay as they are; there must be one. The first and
 * the last row of what is filled have one value each. */
void fill_sphere(struct image *map, const struct image *known);

/* The angle in radians from each pixel of such a map to the nearest that is known, a little too long here and there.
 * angle: [height][width]; INFINITY where nothing is known. */
void fill_angles(const struct image *known, float *angle);

#endif
