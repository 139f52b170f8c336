/* best.h -- the k items of greatest weight out of a stream, in bounded memory.
 *
 * A binary heap with the least of the kept items on top. Of equal weights the lower index wins, so the result depends
 * on the set of items offered and not on their order. */
#ifndef UNBAKE_CAPTURE_BEST_H
#define UNBAKE_CAPTURE_BEST_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define BEST_NONE SIZE_MAX

struct best_item {
    float weight;
    uint32_t index; /* of the item, such as a photograph's */
    uint32_t slot;  /* of the caller's storage */
};

struct best {
    size_t count, capacity;
    struct best_item *item; /* [most] the heap; borrowed */
};

/* An empty heap that keeps up to `capacity` > 0 items. */
void best_init(struct best *best, struct best_item *item, size_t capacity);

/* Whether an item of this weight would be kept now. False where the weight is not above 0, or NaN. */
bool best_takes(const struct best *best, float weight, uint32_t index);

/* Offers an item. Returns its slot in [0, capacity), which may have been that of an item it replaces, or BEST_NONE.
 * Slots in use are always [0, count). */
size_t best_put(struct best *best, float weight, uint32_t index);

#endif
