/* atlas_pack.h -- placing shapes made of cells into a square without overlap.
 *
 * Shapes are bitmaps, so one may lie in a hole or bay of another. They keep a distance: between
 * occupied cells of two shapes at least `padding` cells are free, in every direction. */
#ifndef UNBAKE_SCENE_ATLAS_PACK_H
#define UNBAKE_SCENE_ATLAS_PACK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct pack_item {
    uint32_t width, height; /* cells of the shape's box, not 0 */
    const uint64_t *row;    /* [height][pack_words(width)] bit x % 64 of word x / 64 is cell x;
                             * no bits beyond width; borrowed */
    /* Results: the box, turned by quarter * 90 degrees, has its lower corner at (x, y). */
    uint32_t x, y;
    int quarter;
};

static inline size_t pack_words(uint32_t width) { return ((size_t)width + 63) / 64; }

/* Where the place (x, y) of a w x h box gets by turning the box by quarter * 90 degrees. */
static inline void pack_turn(int quarter, int32_t w, int32_t h, int32_t x, int32_t y, int32_t *turned_x,
                             int32_t *turned_y) {
    switch (quarter) {
    case 0: *turned_x = x, *turned_y = y; break;
    case 1: *turned_x = h - y, *turned_y = x; break;
    case 2: *turned_x = w - x, *turned_y = h - y; break;
    default: *turned_x = y, *turned_y = w - x; break;
    }
}

/* Places all items in a square of size x size cells; false when they do not fit (results are
 * then meaningless). Deterministic. */
bool pack(struct pack_item *item, size_t count, uint32_t size, uint32_t padding);

#endif
