/* rgb_half.h -- colours at half precision, for large arrays. */
#ifndef UNBAKE_SCENE_RGB_HALF_H
#define UNBAKE_SCENE_RGB_HALF_H

#include <stdint.h>

#include "common/image.h"
#include "common/vec.h"

static inline rgb rgb_from_half(const uint16_t half[3]) {
    return rgb_make(image_float_from_half(half[0]), image_float_from_half(half[1]), image_float_from_half(half[2]));
}

static inline void rgb_to_half(uint16_t half[3], rgb value) {
    half[0] = image_half_from_float(value.r);
    half[1] = image_half_from_float(value.g);
    half[2] = image_half_from_float(value.b);
}

#endif
