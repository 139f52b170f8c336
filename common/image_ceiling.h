/* image_ceiling.h -- the value at which a linear picture's file ends. */
#ifndef UNBAKE_COMMON_IMAGE_CEILING_H
#define UNBAKE_COMMON_IMAGE_CEILING_H

#include <math.h>

#include "common/image.h"

#define IMAGE_HALF_LARGEST 65504.0f /* finite number in half precision */

/* Linear value from which one in the file is a lower bound, since writers cut what is brighter or make it infinite: the
 * largest number of half precision. Floats go further than any light. */
static inline float image_ceiling(const struct image_info *info) {
    return info->encoding == IMAGE_LINEAR && info->bits == 16 ? IMAGE_HALF_LARGEST : INFINITY;
}

#endif
