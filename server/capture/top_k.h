/* top_k.h -- the k items of greatest weight out of a stream, in bounded memory.
 *
 * A binary heap with the least of the kept items on top. Of equal weights the lower index wins, so the result depends
 * on the set of items offered and not on their order. */
#ifndef UNBAKE_CAPTURE_TOP_K_H
#define UNBAKE_CAPTURE_TOP_K_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define TOP_K_NONE SIZE_MAX

struct top_k_item {
    float weight;
    uint32_t index; /* of the item, such as a photograph's */
    uint32_t slot;  /* of the caller's storage */
};

struct top_k {
    size_t count, capacity;
    struct top_k_item *item; /* [most] the heap; borrowed */
};

/* An empty heap that keeps up to `capacity` > 0 items. */
void top_k_init(struct top_k *best, struct top_k_item *item, size_t capacity);

/* Whether an item of this weight would be kept now. False where the weight is not above 0, or NaN. */
bool top_k_takes(const struct top_k *best, float weight, uint32_t index);

/* Offers an item. Returns its slot in [0, capacity), which may have been that of an item it replaces, or TOP_K_NONE.
 * Slots in use are always [0, count). */
size_t top_k_put(struct top_k *best, float weight, uint32_t index);

#endif
