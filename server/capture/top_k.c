/* top_k.c -- see top_k.h. */
#include "server/capture/top_k.h"

#include <assert.h>

static bool is_worse(const struct top_k_item *a, const struct top_k_item *b) {
    return a->weight < b->weight || (a->weight == b->weight && a->index > b->index);
}

void top_k_init(struct top_k *best, struct top_k_item *item, size_t capacity) {
    assert(capacity > 0);
    *best = (struct top_k){.capacity = capacity, .item = item};
}

bool top_k_takes(const struct top_k *best, float weight, uint32_t index) {
    struct top_k_item candidate = {.weight = weight, .index = index};
    return weight > 0.0f && (best->count < best->capacity || is_worse(&best->item[0], &candidate));
}

/* Moves an item up the heap from place `at`, past those that are better. */
static void sift_up(struct top_k *best, size_t at, struct top_k_item item) {
    for (; at > 0 && is_worse(&item, &best->item[(at - 1) / 2]); at = (at - 1) / 2)
        best->item[at] = best->item[(at - 1) / 2];
    best->item[at] = item;
}

/* Moves an item down from the top, past those that are worse. */
static void sift_down(struct top_k *best, struct top_k_item item) {
    size_t at = 0;
    for (size_t child = 1; child < best->count; child = 2 * at + 1) {
        if (child + 1 < best->count && is_worse(&best->item[child + 1], &best->item[child]))
            child++;
        if (!is_worse(&best->item[child], &item))
            break;
        best->item[at] = best->item[child];
        at = child;
    }
    best->item[at] = item;
}

size_t top_k_put(struct top_k *best, float weight, uint32_t index) {
    if (!top_k_takes(best, weight, index))
        return TOP_K_NONE;
    bool has_room = best->count < best->capacity;
    struct top_k_item item = {weight, index, has_room ? (uint32_t)best->count : best->item[0].slot};
    if (has_room)
        sift_up(best, best->count++, item);
    else
        sift_down(best, item);
    return item.slot;
}
