/* stated.h -- the standard deviation of base colour that outputs state (confidence.exr), as a camera sees it. */
#ifndef UNBAKE_EVALUATE_STATED_H
#define UNBAKE_EVALUATE_STATED_H

#include <stdint.h>

#include "common/error.h"
#include "common/image.h"
#include "common/parallel.h"
#include "server/relight/recovered.h"
#include "server/scene/camera.h"

/* Of the outputs in a folder, which `recovered` was loaded from; texture_release. texel is NULL where they state none:
 * outputs of before had something else under that name, or nothing. */
enum status stated_load(const char *outputs, const struct recovered *recovered, struct texture *deviation,
                        struct error *err);

/* Into a new image with the channels base_color.R G B and others, which mean nothing. */
void stated_render(struct recovered *recovered, const struct texture *deviation, const struct camera *camera,
                   uint32_t samples, uint64_t seed, struct parallel *pool, struct image *image);

#endif
