/* parallel.h: every index once, slots never shared at one time, loops may follow at once. */
#include "common/parallel.h"

#include <stdatomic.h>

#include "tests/check.h"

#define COUNT 10000

struct shared {
    atomic_int visits[COUNT];
    atomic_int busy[8];
    atomic_int clashes;
};

static void body(void *user, size_t index, int thread) {
    struct shared *s = user;
    if (atomic_exchange(&s->busy[thread], 1))
        atomic_fetch_add(&s->clashes, 1);
    atomic_fetch_add(&s->visits[index], 1);
    atomic_store(&s->busy[thread], 0);
}

int main(void) {
    static struct shared s;
    for (int threads = 1; threads <= 7; threads += 3) {
        struct parallel *pool = parallel_new(threads);
        CHECK(parallel_thread_count(pool) == threads);
        memset(&s, 0, sizeof s);
        for (int round = 0; round < 20; round++)
            parallel_for(pool, COUNT, body, &s);
        parallel_for(pool, 0, body, &s);
        for (size_t i = 0; i < COUNT; i++)
            CHECK(s.visits[i] == 20);
        CHECK(s.clashes == 0);
        parallel_free(pool);
    }
    return check_result();
}
