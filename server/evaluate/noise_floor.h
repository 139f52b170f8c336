/* noise_floor.h -- what MSRE a photograph's own noise makes, told by a render of the same view with standard errors.
 *
 * The truth may hold renders of the room in flat colours, truth/flat_NNN.exr, with the channels R G B and err.R G B,
 * the standard error of each pixel's mean. A path tracer's noise is proportional to what it shows, so the
 * photograph's is that of the flat render, by the ratio of what both show and by their numbers of samples. No
 * re-render, that of the true room neither, has a smaller MSRE in the mean. */
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

/* The MSRE of a photograph (as metrics.h has it) by the errors of `flat`, which is of its size and has the channels. */
double noise_floor_of(const struct image *photograph, const struct image *flat, double median_radiance);

/* Adds a view whose re-render has that MSRE; does nothing where no file is at `path`. */
enum status noise_floor_add(struct noise_floor *sum, const char *path, const struct image *photograph, double msre,
                            double median_radiance, struct error *err);

#endif
