/* plain_surface.h -- noise of recovered base colour where the truth has none: what varies on surfaces of one base
 * colour. Over pixels that show seen surface (SCORE_SEEN of score.h). */
#ifndef UNBAKE_EVALUATE_PLAIN_SURFACE_H
#define UNBAKE_EVALUATE_PLAIN_SURFACE_H

#include <stddef.h>
#include <stdint.h>

#include "common/image.h"

#define PLAIN_SURFACE_SPECK 0.03f /* reflectance; on a wall of .7 four steps of 8-bit sRGB: visible */

/* Sums over pixels whose 5 x 5 neighbourhood shows one object of about one base colour in the truth. A pixel's
 * deviation is its error less the mean error of that neighbourhood. */
struct plain_surface {
    double squares; /* of deviations, over the three channels */
    size_t pixels;
    size_t specks; /* pixels with a channel that deviates by more than PLAIN_SURFACE_SPECK */
};

/* Adds a view. Pictures of one size with the channels base_color.R G B; truth also object_id. flags[height * width] as
 * score.h has them. */
void plain_surface_add(struct plain_surface *plain, const struct image *found, const struct image *truth,
                       const uint8_t *flags);

/* Standard deviation of base colour; NaN where nothing is plain. */
double plain_surface_spread(const struct plain_surface *plain);

#endif
