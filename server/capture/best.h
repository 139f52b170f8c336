/* best.h -- the best of any number of items by weight, in bounded memory.
 *
 * A binary heap with the worst of those that are kept on top. Of equal weights the lower index is the better one, so
 * what is kept depends on what was offered alone, not on the order. */
#ifndef UNBAKE_CAPTURE_BEST_H
#define UNBAKE_CAPTURE_BEST_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define BEST_NONE SIZE_MAX

struct best_item {
    float weight;
    uint32_t index; /* of the item, such as a photograph's */
    uint32_t slot;  /* where the caller keeps it */
};

struct best {
    size_t count, capacity;
    struct best_item *item; /* [most] the heap; borrowed */
};

/* Keeps up to most > 0 of what is offered from now on. */
void best_init(struct best *best, struct best_item *item, size_t capacity);

/* Whether an item of this weight would be kept now. Never where it is not above 0, or not a number. */
bool best_takes(const struct best *best, float weight, uint32_t index);

/* Offers an item; returns the slot in [0, most) that it has from now on, which may have been another's, or BEST_NONE.
 * Slots are given out in order: with `count` items those in use are [0, count). */
size_t best_put(struct best *best, float weight, uint32_t index);

#endif
