/* quantile.h: order does not matter, ends are kept within, nothing has no quantile; and the
 * median of what is known in part. */
#include "common/quantile.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/rng.h"
#include "tests/check.h"

static bool median_is(struct bounded *value, size_t count, float expected) {
    float median;
    bool known = quantile_bounded_median(value, count, &median);
    CHECK_NEAR(median, expected, 0.0f);
    return known;
}

/* 0 to 99 as photographs of three exposures show them, of which two can show no more than 19 and 59. */
static void test_exposures(void) {
    static const int clip[] = {20, 60, 1000};
    struct bounded value[300];
    float median;
    for (int i = 0; i < 300; i++)
        value[i] = (struct bounded){fminf((float)(i / 3), (float)clip[i % 3]), i / 3 >= clip[i % 3]};
    CHECK(quantile_bounded_median(value, 300, &median));
    CHECK_NEAR(median, 50.0f, 1.0f);
}

static void test_bounded(void) {
    struct bounded all[] = {{3, false}, {-1, false}, {2, false}, {5, false}, {4, false}};
    CHECK(median_is(all, 5, 3.0f));
    CHECK(median_is(all, 4, 3.0f)); /* of -1 2 3 4: the upper median */
    CHECK(!median_is(all, 0, 0.0f));
    /* A lamp at which two of three saturate. */
    struct bounded lamp[] = {{1, true}, {31, false}, {5, true}, {1, true}, {30, false}, {5, true}};
    CHECK(median_is(lamp, 6, 31.0f));
    /* Most are beyond 5: nobody knows how far. */
    struct bounded beyond[] = {{5, true}, {1, false}, {5, true}, {5, true}, {2, false}};
    CHECK(!median_is(beyond, 5, 5.0f));
    /* A bound that is as large as a value is beyond it. */
    struct bounded equal[] = {{2, true}, {2, false}, {2, false}};
    CHECK(median_is(equal, 3, 2.0f));
}

enum { MOST = 300, ORDERS = 5 };

static int ascending(const void *a, const void *b) {
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

/* Values with many that are equal (as of 8-bit pictures): in no order, ascending, descending, rising and falling, all
 * equal. */
static void fill(float *value, size_t count, int order, uint64_t key) {
    for (size_t i = 0; i < count; i++)
        value[i] = order == 4 ? 7.0f : (float)(rng_key(key, i, 0) % (1 + key % 90)) - 20.0f;
    if (order > 0)
        qsort(value, count, sizeof *value, ascending);
    for (size_t i = 0; order == 2 && i < count / 2; i++) {
        float kept = value[i];
        value[i] = value[count - 1 - i];
        value[count - 1 - i] = kept;
    }
    for (size_t i = 0; order == 3 && i < count; i++)
        value[i] = (float)(i < count / 2 ? i : count - i);
}

/* What sorting finds. */
static void test_selection(void) {
    float value[MOST], sorted[MOST];
    for (uint64_t key = 1; key <= 2000; key++) {
        size_t count = 1 + rng_mix64(key) % MOST;
        double share = (double)(rng_mix64(key + 5000) % 1001) / 1000.0;
        size_t at = (size_t)(share * (double)count);
        fill(value, count, (int)(key % ORDERS), key);
        memcpy(sorted, value, count * sizeof *value);
        qsort(sorted, count, sizeof *sorted, ascending);
        CHECK(quantile(value, count, share) == sorted[at < count ? at : count - 1]);
        qsort(value, count, sizeof *value, ascending);
        CHECK(memcmp(value, sorted, count * sizeof *value) == 0); /* none is lost */
    }
}

int main(void) {
    test_bounded();
    test_exposures();
    test_selection();
    float value[] = {3.0f, -1.0f, 2.0f, 5.0f, 4.0f}, four[] = {3.0f, 4.0f, 2.0f, -1.0f};
    CHECK(quantile(value, 5, 0.5) == 3.0f);
    CHECK(quantile(value, 5, 0.0) == -1.0f);
    CHECK(quantile(value, 5, 1.0) == 5.0f);
    CHECK(quantile(four, 4, 0.5) == 3.0f); /* the upper median */
    CHECK(quantile(value, 0, 0.5) == 0.0f);
    return check_result();
}
