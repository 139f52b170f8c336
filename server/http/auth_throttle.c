/* auth_throttle.c -- see auth_throttle.h. A set-associative table, as in a processor's cache: each address belongs to
 * one set. */
#include "server/http/auth_throttle.h"

#include <math.h>
#include <pthread.h>
#include <string.h>
#include <sys/random.h>

#include "common/mem.h"

#define SET_COUNT 1024 /* a power of 2 */
#define WAY_COUNT 4    /* 4,096 addresses: 160 KiB */

struct throttle_slot {
    uint8_t key[16]; /* all zero ("::"): unknown address, or unused entry; they are treated alike */
    double room;     /* failures left, at since_sec */
    double since_sec;
    bool is_throttled;
};

struct auth_throttle {
    pthread_mutex_t mutex;
    uint64_t seed; /* random, so that nobody can choose addresses of another's set */
    struct throttle_slot slots[SET_COUNT][WAY_COUNT];
};

struct auth_throttle *auth_throttle_new(void) {
    struct auth_throttle *b = mem_calloc(1, sizeof *b);
    pthread_mutex_init(&b->mutex, NULL);
    if (getrandom(&b->seed, sizeof b->seed, 0) != sizeof b->seed)
        b->seed = 1;
    for (size_t i = 0; i < SET_COUNT * WAY_COUNT; i++)
        b->slots[i / WAY_COUNT][i % WAY_COUNT].room = AUTH_THROTTLE_BURST;
    return b;
}

void auth_throttle_free(struct auth_throttle *b) {
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

static void refill(struct throttle_slot *s, double now_sec) {
    s->room = fmin(AUTH_THROTTLE_BURST, s->room + AUTH_THROTTLE_PER_SEC * fmax(now_sec - s->since_sec, 0.0));
    s->since_sec = now_sec;
}

static struct throttle_slot *find(struct auth_throttle *b, const struct address *from, double now_sec) {
    uint8_t key[16];
    uint64_t halves[2];
    make_key(from, key);
    memcpy(halves, key, sizeof halves);
    struct throttle_slot *set = b->slots[mix(mix(b->seed ^ halves[0]) ^ halves[1]) % SET_COUNT], *best = set;
    for (size_t i = 0; i < WAY_COUNT; i++) {
        refill(&set[i], now_sec);
        if (memcmp(set[i].key, key, sizeof key) == 0)
            return &set[i];
        if (set[i].room > best->room)
            best = &set[i];
    }
    memcpy(best->key, key, sizeof key);
    best->room = AUTH_THROTTLE_BURST;
    best->is_throttled = false;
    return best;
}

double auth_throttle_fail(struct auth_throttle *b, const struct address *from, double now_sec, bool *is_first) {
    pthread_mutex_lock(&b->mutex);
    struct throttle_slot *s = find(b, from, now_sec);
    bool has_room = s->room >= 1.0;
    double wait_sec = has_room ? 0.0 : (1.0 - s->room) / AUTH_THROTTLE_PER_SEC;
    *is_first = !has_room && !s->is_throttled;
    s->is_throttled = !has_room;
    s->room -= has_room ? 1.0 : 0.0;
    pthread_mutex_unlock(&b->mutex);
    return wait_sec;
}
