/* even.h -- how much of MSRE is the photographs' own noise, told without a renderer.
 *
 * Where all pixels around one show the same object in the same base colour, and it is rough, light changes slowly from
 * one to the next: what a pixel should show is told by the quadratic through 7 x 7 of them (Savitzky and Golay 1964). By
 * what it is off from that it is off from any re-render, however right. */
#ifndef UNBAKE_EVALUATE_EVEN_H
#define UNBAKE_EVALUATE_EVEN_H

#include <stddef.h>

#include "common/image.h"

struct even {
    double render, noise; /* sums over pixels: what the re-render adds to MSRE, and what the photograph's noise does */
    size_t count;         /* pixels */
};

/* Adds the even places of a view. Pictures are of one size: photograph and render as metrics.h has them, truth with the
 * channels base_color.R G B, roughness and object_id. */
void even_add(struct even *even, const struct image *photograph, const struct image *render, const struct image *truth,
              double median_radiance);

#endif
