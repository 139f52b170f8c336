/* noise_floor.h -- the MSRE caused by a photograph's own noise, from a render of the same view with standard errors.
 *
 * The truth may contain renders of the room in flat colours, truth/flat_NNN.exr, with channels R G B and err.R G B,
 * the standard error of each pixel's mean. The noise of a path tracer is proportional to radiance, so the
 * photograph's noise is that of the flat render scaled by the ratio of their radiances and of their sample counts. No
 * re-render, including one of the true room, has a smaller expected MSRE. */
#ifndef UNBAKE_EVALUATE_NOISE_FLOOR_H
#define UNBAKE_EVALUATE_NOISE_FLOOR_H

#include <stddef.h>

#include "common/error.h"
#include "common/image.h"

/* Sums over the views that have such a render. */
struct noise_floor {
    double msre, floor; /* of the re-render; of the photograph's noise */
    size_t count;       /* views */
};

/* Expected MSRE of a photograph's noise (pixels as in metrics.h) from the errors of `flat`, of the same size. */
double noise_floor_of(const struct image *photograph, const struct image *flat, double median_radiance);

/* Adds a view whose re-render has that MSRE; does nothing when there is no file at `path`. */
enum status noise_floor_add(struct noise_floor *sum, const char *path, const struct image *photograph, double msre,
                            double median_radiance, struct error *err);

#endif
