/* ordered.c -- see ordered.h. */
#include "common/ordered.h"

#include "common/mem.h"

#define SLICE 65536 /* results that are made before they are taken */
#define CHUNK 256   /* results a work item */

struct slice {
    void (*make)(void *user, size_t index, void *result);
    void *user;
    size_t first, count, size;
    char *result; /* [SLICE][size] */
};

static void make_chunk(void *user, size_t chunk, int thread) {
    (void)thread;
    const struct slice *s = user;
    size_t end = (chunk + 1) * CHUNK < s->count ? (chunk + 1) * CHUNK : s->count;
    for (size_t i = chunk * CHUNK; i < end; i++)
        s->make(s->user, s->first + i, s->result + i * s->size);
}

void ordered_for(struct parallel *pool, size_t count, size_t size, void (*make)(void *user, size_t index, void *result),
                 void (*take)(void *user, size_t index, const void *result), void *user) {
    struct slice s = {.make = make, .user = user, .size = size};
    s.result = mem_array(count < SLICE ? count + 1 : SLICE, size);
    for (s.first = 0; s.first < count; s.first += SLICE) {
        s.count = count - s.first < SLICE ? count - s.first : SLICE;
        parallel_for(pool, (s.count + CHUNK - 1) / CHUNK, make_chunk, &s);
        for (size_t i = 0; i < s.count; i++)
            take(user, s.first + i, s.result + i * size);
    }
    mem_free(s.result);
}
