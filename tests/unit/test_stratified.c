/* stratified.h: permutations permute, even steps reach all; an epoch visits every texel once, evenly over the surface.
 */
#include "server/capture/stratified.h"

#include "tests/check.h"

static void test_permutation(void) {
    static unsigned char seen[1000];
    const uint32_t counts[] = {1, 2, 3, 7, 64, 100, 999, 1000};
    for (size_t c = 0; c < sizeof counts / sizeof counts[0]; c++) {
        memset(seen, 0, sizeof seen);
        for (uint32_t i = 0; i < counts[c]; i++) {
            uint32_t place = stratified_permute(i, counts[c], 12345u + (uint32_t)c);
            CHECK(place < counts[c]);
            CHECK(place >= counts[c] || seen[place]++ == 0);
        }
    }
}

/* The place of index 0 over many keys is even: chi-square, 15 degrees, 0.1 % at 37.7. */
static void test_even(void) {
    double count[16] = {0}, chi = 0.0;
    for (uint32_t key = 0; key < 16000; key++)
        count[stratified_permute(0, 16, key * 2654435761u)] += 1.0;
    for (int i = 0; i < 16; i++)
        chi += (count[i] - 1000.0) * (count[i] - 1000.0) / 1000.0;
    CHECK_THAT(chi < 37.7, "chi-square %.1f", chi);
}

/* All are visited, and the first `part` of them leave no gap of more than a few times the mean. */
static void test_even_step(size_t count, size_t part) {
    unsigned char *seen = calloc(count, 1);
    size_t step = stratified_even_step(count), gap = 0, widest = 0;
    for (size_t i = 0; i < part; i++)
        seen[i * step % count]++;
    for (size_t i = 0; i < count; i++) {
        gap = seen[i] ? 0 : gap + 1;
        widest = gap > widest ? gap : widest;
    }
    CHECK_THAT(widest * part <= 6 * count, "%zu of %zu leave a gap of %zu", part, count, widest);
    for (size_t i = part; i < count; i++)
        seen[i * step % count]++;
    for (size_t i = 0; i < count; i++)
        CHECK_THAT(seen[i] == 1, "%zu of %zu is visited %d times", i, count, seen[i]);
    free(seen);
}

static void test_epoch(size_t items, size_t per_iteration) {
    struct stratified c;
    stratified_init(&c, items, per_iteration, 7);
    unsigned char *visits = calloc(items, 1);
    for (uint64_t epoch = 0; epoch < 3; epoch++) {
        for (uint64_t i = 0; i < c.epoch_length; i++) {
            for (size_t s = 0; s < c.stratum_count; s++) {
                size_t item = stratified_item(&c, epoch * c.epoch_length + i, s);
                if (item == STRATIFIED_NONE)
                    continue;
                CHECK(item >= s * items / c.stratum_count && item < (s + 1) * items / c.stratum_count);
                visits[item]++;
            }
        }
        for (size_t i = 0; i < items; i++)
            CHECK_THAT(visits[i] == epoch + 1, "item %zu was visited %d times", i, visits[i]);
    }
    free(visits);
}

int main(void) {
    test_permutation();
    test_even();
    test_even_step(1, 1);
    test_even_step(2, 1);
    test_even_step(97, 10);
    test_even_step(1000, 24);
    test_even_step(5040, 256);
    test_even_step(65536, 1024);
    test_epoch(1000, 64);
    test_epoch(1000, 1000);
    test_epoch(10, 64);
    test_epoch(1, 1);
    test_epoch(4097, 100);
    return check_result();
}
