/* blocks.h -- square blocks of 2^level x 2^level texels, whose base colours are scaled by a common factor. */
#ifndef UNBAKE_REFINE_BLOCKS_H
#define UNBAKE_REFINE_BLOCKS_H

#include <stddef.h>
#include <stdint.h>

#include "common/vec.h"
#include "server/scene/texture.h"

/* Lower bound of scaled base colour: no factor could raise 0 again. */
#define BLOCKS_MIN_COLOR 0.002f /* +25 %: no change */

/* Number of blocks across that many texels. */
static inline size_t blocks_across(uint32_t texels, int level) {
    return ((size_t)texels + ((size_t)1 << level) - 1) >> level;
}

static inline size_t blocks_count(const struct texture *t, int level) {
    return blocks_across(t->width, level) * blocks_across(t->height, level);
}

/* The number of the block that holds a texel; rows of blocks follow each other. */
static inline size_t blocks_at(const struct texture *t, size_t texel, int level) {
    return (texel / t->width >> level) * blocks_across(t->width, level) + (texel % t->width >> level);
}

static inline void blocks_scale(float color[3], const float factor[3]) {
    for (int c = 0; c < 3; c++)
        color[c] = clampf(color[c] * factor[c], BLOCKS_MIN_COLOR, 1.0f);
}

#endif
