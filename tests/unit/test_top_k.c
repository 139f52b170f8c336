/* top_k.h: of any number of items the best are kept by weight, as sorting all of them would choose, in whatever order
 * they come; equal weights go by index; what weighs nothing, or is no number, is not taken. */
#include "common/mem.h"
#include "common/rng.h"
#include "server/capture/top_k.h"
#include "tests/check.h"

#define MOST 48

static int by_rank(const void *a, const void *b) {
    const struct top_k_item *x = a, *y = b;
    if (x->weight != y->weight)
        return x->weight < y->weight ? 1 : -1;
    return (x->index > y->index) - (x->index < y->index);
}

enum order { FORTH, BACK, SHUFFLED, ORDERS };

static uint32_t item_at(enum order order, uint32_t i, uint32_t count) {
    return order == FORTH ? i : order == BACK ? count - 1 - i : (uint32_t)((uint64_t)i * 7919 % count);
}

/* `levels` different weights among `count` items. */
static void check_kept(uint32_t count, uint32_t levels) {
    struct top_k_item *all = mem_array(count, sizeof *all);
    for (uint32_t i = 0; i < count; i++)
        all[i] = (struct top_k_item){.weight = 1.0f + (float)rng_below((uint32_t)rng_key(1, i, 0), levels), .index = i};
    struct top_k_item *sorted = mem_array(count, sizeof *sorted);
    memcpy(sorted, all, count * sizeof *all);
    qsort(sorted, count, sizeof *sorted, by_rank);
    for (enum order order = FORTH; order < ORDERS; order++) {
        struct top_k best;
        struct top_k_item item[MOST];
        uint32_t kept[MOST];
        top_k_init(&best, item, MOST);
        for (uint32_t i = 0; i < count; i++) {
            const struct top_k_item *offered = &all[item_at(order, i, count)];
            bool takes = top_k_takes(&best, offered->weight, offered->index);
            size_t slot = top_k_put(&best, offered->weight, offered->index);
            CHECK(takes == (slot != TOP_K_NONE));
            if (slot != TOP_K_NONE)
                kept[slot] = offered->index;
        }
        CHECK(best.count == (count < MOST ? count : MOST));
        for (size_t k = 0; k < best.count; k++) {
            size_t found = 0;
            while (found < best.count && kept[found] != sorted[k].index)
                found++;
            CHECK_THAT(found < best.count, "%u items, order %d: number %zu of the best, %u, is not kept", count,
                       (int)order, k, sorted[k].index);
            if (order == FORTH && count <= MOST)
                CHECK(kept[k] == k);
        }
    }
    mem_free(sorted);
    mem_free(all);
}

int main(void) {
    const uint32_t counts[] = {1, 2, 47, 48, 49, 257, 300, 2003, 20011};
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
        check_kept(counts[i], 1);
        check_kept(counts[i], 5);
        check_kept(counts[i], 1u << 24);
    }
    struct top_k best;
    struct top_k_item item[2];
    top_k_init(&best, item, 2);
    CHECK(top_k_put(&best, NAN, 0) == TOP_K_NONE && top_k_put(&best, 0.0f, 1) == TOP_K_NONE);
    CHECK(top_k_put(&best, -1.0f, 2) == TOP_K_NONE && best.count == 0);
    CHECK(top_k_put(&best, 1.0f, 3) == 0 && top_k_put(&best, INFINITY, 4) == 1 && top_k_put(&best, 2.0f, 5) == 0);
    CHECK(!top_k_takes(&best, 2.0f, 6) && top_k_takes(&best, 2.0f, 4) && !top_k_takes(&best, NAN, 0));
    return check_result();
}
