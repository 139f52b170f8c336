/* ordered.h: results are made once each and taken in order, more than are held at once, on any number of threads. */
#include "common/ordered.h"

#include <string.h>

#include "common/rng.h"
#include "tests/check.h"

struct sums {
    size_t next; /* index that is to be taken next */
    double sum;
};

static void make(void *user, size_t index, void *result) {
    (void)user;
    *(double *)result = (double)rng_to_float((uint32_t)rng_key(1, index, 0)) - 0.5;
}

static void take(void *user, size_t index, const void *result) {
    struct sums *s = user;
    CHECK(index == s->next);
    s->next++;
    s->sum += *(const double *)result;
}

static void check_count(size_t count) {
    double plain = 0.0;
    for (size_t i = 0; i < count; i++) {
        double value;
        make(NULL, i, &value);
        plain += value;
    }
    for (int threads = 1; threads <= 5; threads += 2) {
        struct parallel *pool = parallel_new(threads);
        struct sums s = {0, 0.0};
        ordered_for(pool, count, sizeof(double), make, take, &s);
        CHECK(s.next == count && memcmp(&s.sum, &plain, sizeof plain) == 0);
        parallel_free(pool);
    }
}

int main(void) {
    check_count(0);
    check_count(1);
    check_count(257);
    check_count(65536);
    check_count(150001);
    return check_result();
}
