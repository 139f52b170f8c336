/* brake.c -- see brake.h. A table of sets, as a processor's cache has it: an address can only be in one set. */
#include "server/http/brake.h"

#include <math.h>
#include <pthread.h>
#include <string.h>
#include <sys/random.h>

#include "common/mem.h"

#define SET_COUNT 1024 /* a power of 2 */
#define WAY_COUNT 4    /* 4,096 addresses: 160 KiB */

struct slot {
    uint8_t key[16]; /* all zero, "::": the unknown address, or not in use, which is the same */
    double room;     /* failures, at since_sec */
    double since_sec;
    bool is_braked;
};

struct brake {
    pthread_mutex_t mutex;
    uint64_t seed; /* so that nobody can aim at another's set */
    struct slot slots[SET_COUNT][WAY_COUNT];
};

struct brake *brake_new(void) {
    struct brake *b = mem_calloc(1, sizeof *b);
    pthread_mutex_init(&b->mutex, NULL);
    if (getrandom(&b->seed, sizeof b->seed, 0) != sizeof b->seed)
        b->seed = 1;
    for (size_t i = 0; i < SET_COUNT * WAY_COUNT; i++)
        b->slots[i / WAY_COUNT][i % WAY_COUNT].room = BRAKE_BURST;
    return b;
}

void brake_free(struct brake *b) {
    if (b)
        pthread_mutex_destroy(&b->mutex);
    mem_free(b);
}

/* The finaliser of splitmix64 (Steele, Lea and Flood 2014). */
static uint64_t mix(uint64_t x) {
    x = (x ^ x >> 30) * 0xbf58476d1ce4e5b9u;
    x = (x ^ x >> 27) * 0x94d049bb133111ebu;
    return x ^ x >> 31;
}

static void make_key(const struct address *from, uint8_t key[16]) {
    static const uint8_t v4_prefix[12] = {[10] = 0xff, [11] = 0xff};
    memcpy(key, from->bytes, 16);
    if (memcmp(key, v4_prefix, sizeof v4_prefix) != 0)
        memset(key + 8, 0, 8);
}

static void refill(struct slot *s, double now_sec) {
    s->room = fmin(BRAKE_BURST, s->room + BRAKE_PER_SEC * fmax(now_sec - s->since_sec, 0.0));
    s->since_sec = now_sec;
}

static struct slot *find(struct brake *b, const struct address *from, double now_sec) {
    uint8_t key[16];
    uint64_t halves[2];
    make_key(from, key);
    memcpy(halves, key, sizeof halves);
    struct slot *set = b->slots[mix(mix(b->seed ^ halves[0]) ^ halves[1]) % SET_COUNT], *best = set;
    for (size_t i = 0; i < WAY_COUNT; i++) {
        refill(&set[i], now_sec);
        if (memcmp(set[i].key, key, sizeof key) == 0)
            return &set[i];
        if (set[i].room > best->room)
            best = &set[i];
    }
    memcpy(best->key, key, sizeof key);
    best->room = BRAKE_BURST;
    best->is_braked = false;
    return best;
}

double brake_fail(struct brake *b, const struct address *from, double now_sec, bool *is_first) {
    pthread_mutex_lock(&b->mutex);
    struct slot *s = find(b, from, now_sec);
    bool has_room = s->room >= 1.0;
    double wait_sec = has_room ? 0.0 : (1.0 - s->room) / BRAKE_PER_SEC;
    *is_first = !has_room && !s->is_braked;
    s->is_braked = !has_room;
    s->room -= has_room ? 1.0 : 0.0;
    pthread_mutex_unlock(&b->mutex);
    return wait_sec;
}
