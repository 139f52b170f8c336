/* smooth_areas.h -- the share of MSRE that is the photographs' own noise, estimated without a renderer.
 *
 * Where the neighbourhood of a pixel shows one rough object of one base colour, radiance varies slowly: its expected
 * value is that of a quadratic fitted to 7 x 7 pixels (Savitzky and Golay 1964). The pixel's deviation from it is
 * noise, which no re-render can match. */
#ifndef UNBAKE_EVALUATE_SMOOTH_AREAS_H
#define UNBAKE_EVALUATE_SMOOTH_AREAS_H

#include <stddef.h>

#include "common/image.h"

struct smooth_areas {
    double render; /* sum over pixels of the MSRE of the re-renders, free of their noise */
    double noise;  /* the same of the photograph's noise */
    size_t count;  /* pixels */
};

/* Adds the smooth areas of a view. All pictures are of one size: photograph and halves as in metrics.h, truth with
 * the channels base_color.R G B, roughness and object_id. */
void smooth_areas_add(struct smooth_areas *areas, const struct image *photograph, const struct image *halves,
                      const struct image *truth, double median_radiance);

#endif
