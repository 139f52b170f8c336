/* stratified.c -- see stratified.h. */
#include "server/capture/stratified.h"

#include "common/rng.h"
#include "common/spaced.h"

uint32_t stratified_permute(uint32_t index, uint32_t count, uint32_t key) {
    uint32_t mask = count - 1;
    mask |= mask >> 1;
    mask |= mask >> 2;
    mask |= mask >> 4;
    mask |= mask >> 8;
    mask |= mask >> 16;
    int shift = (32 - __builtin_clz(mask | 1)) / 2;
    shift = shift > 0 ? shift : 1;
    /* Each round is a bijection of [0, mask]; repeating until the value is below count restricts it to [0, count). */
    do {
        for (uint32_t round = 0; round < 5; round++) {
            uint32_t k = rng_mix32(key + round * UINT32_C(0x9e3779b9));
            index = (index * (k | 1) + (k >> 7)) & mask;
            index ^= index >> shift;
        }
    } while (index >= count);
    return index;
}

size_t stratified_even_step(size_t count) {
    for (size_t step = (size_t)(0.6180339887 * (double)count) + 1;; step++) {
        size_t a = count, b = step;
        while (b != 0) {
            size_t rest = a % b;
            a = b, b = rest;
        }
        if (a == 1)
            return step;
    }
}

void stratified_init(struct stratified *c, size_t item_count, size_t per_iteration, uint64_t seed) {
    c->item_count = item_count;
    c->stratum_count = per_iteration < item_count ? per_iteration : item_count;
    c->epoch_length = c->stratum_count ? (item_count + c->stratum_count - 1) / c->stratum_count : 0;
    c->seed = seed;
}

size_t stratified_item(const struct stratified *c, uint64_t iteration, size_t stratum) {
    uint64_t epoch = iteration / c->epoch_length;
    uint32_t turn = (uint32_t)(iteration % c->epoch_length);
    size_t first = spaced(stratum, c->item_count, c->stratum_count);
    size_t end = spaced(stratum + 1, c->item_count, c->stratum_count);
    uint32_t key = (uint32_t)rng_key(c->seed, epoch, stratum);
    uint32_t place = stratified_permute(turn, (uint32_t)c->epoch_length, key);
    return first + place < end ? first + place : STRATIFIED_NONE;
}
