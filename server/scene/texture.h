/* texture.h -- a colour texture over the atlas, and its filter.
 *
 * A texel holds (r, g, b, valid): valid is 1 where the inverse UV map has a surface and 0 elsewhere. The filter is
 * bilinear over the valid ones of the four nearest texels with renormalised weights: nothing leaks in from outside
 * charts, and the derivative of a lookup is its four weights. */
#ifndef UNBAKE_SCENE_TEXTURE_H
#define UNBAKE_SCENE_TEXTURE_H

#include <stddef.h>
#include <stdint.h>

#include "common/vec.h"
#include "server/scene/inverse_uv.h"

struct texture {
    uint32_t width, height;
    float (*texel)[4]; /* [height][width] r g b valid; owned */
};

struct texture_taps {
    uint32_t texel[4]; /* y * width + x; weight 0 taps repeat a valid one */
    float weight[4];   /* sum is 1, or all 0 when no tap is valid */
};

/* All valid texels get `value`. */
void texture_init(struct texture *texture, const struct inverse_uv *inverse, rgb value);
void texture_release(struct texture *texture);

/* The taps at (x, y), in texels. */
void texture_taps(const struct texture *texture, float x, float y, struct texture_taps *taps);
rgb texture_gather(const struct texture *texture, const struct texture_taps *taps);

#endif
