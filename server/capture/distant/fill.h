/* fill.h -- fills in a latitude-longitude map where nothing is known.
 *
 * Distant surroundings are alike around the horizon: sky above, ground below. Each row gets a colour: ratios of rows
 * are those within columns, rows of which nothing is known continue the nearest ones. The ratio of known pixels to
 * their row is propagated, as a logarithm, by pull-push (Gortler et al. 1996, The Lumigraph, section 3.4), weighted by
 * solid angle and periodic in azimuth, then smoothed by diffusion with the sphere's metric: the fill continues known
 * pixels next to them and tends to the row's colour far away. Highlights are clamped first: a sun at the rim of a
 * window would otherwise light half of the sky. */
#ifndef UNBAKE_CAPTURE_DISTANT_FILL_H
#define UNBAKE_CAPTURE_DISTANT_FILL_H

#include <stdbool.h>

#include "common/image.h"

/* map: three channels, finite, not negative; width = 2 height, a power of two. Pixels that are known stay as they are;
 * there must be one. The first and the last row of the fill have one value each. is_known: [height][width]. */
void fill_sphere(struct image *map, const bool *is_known);

/* Angle in radians from each pixel of such a map to the nearest known one; slightly too large for some. is_known,
 * angle: [height][width]; INFINITY where nothing is known. */
void fill_angles(uint32_t width, uint32_t height, const bool *is_known, float *angle);

#endif
