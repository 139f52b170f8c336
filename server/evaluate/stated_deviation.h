/* stated_deviation.h -- the standard deviation of base colour that outputs state (confidence.exr), as a camera sees it,
 * and how true it is. */
#ifndef UNBAKE_EVALUATE_STATED_DEVIATION_H
#define UNBAKE_EVALUATE_STATED_DEVIATION_H

#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "common/image.h"
#include "common/parallel.h"
#include "server/relight/recovered.h"
#include "server/scene/camera.h"

/* Reads it from the folder of outputs that `recovered` was loaded from; texture_release. texel is NULL where they state
 * none: outputs of earlier versions have something else under that name, or nothing. */
enum status stated_deviation_load(const char *outputs, const struct recovered *recovered, struct texture *deviation,
                                  struct error *err);

/* Into a new image with the channels base_color.R G B and others, which mean nothing. */
void stated_deviation_render(struct recovered *recovered, const struct texture *deviation, const struct camera *camera,
                             uint32_t samples, uint64_t seed, struct parallel *pool, struct image *image);

/* How many errors lie within the deviations that are stated for them; of a normal distribution 68 and 95 %. */
struct deviation_coverage {
    size_t within_one, within_two; /* errors of at most one, two deviations */
    size_t count;                  /* errors: three channels a pixel */
};

/* Adds the seen pixels of a view. Pictures of one size with the channels base_color.R G B: recovered, its stated
 * deviation and true; flags[height * width] as score.h has them. */
void deviation_coverage_add(struct deviation_coverage *coverage, const struct image *found,
                            const struct image *deviation, const struct image *truth, const uint8_t *flags);

#endif
