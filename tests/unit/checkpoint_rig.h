/* checkpoint_rig.h -- a state that follows from the iteration, saved and loaded. */
#ifndef UNBAKE_TESTS_UNIT_CHECKPOINT_RIG_H
#define UNBAKE_TESTS_UNIT_CHECKPOINT_RIG_H

#include "common/file.h"
#include "common/mem.h"
#include "server/worker/checkpoint.h"
#include "tests/check.h"

static struct error err;

#define OK(call) CHECK_THAT((call) == STATUS_OK, "%s", err.message)
#define IS(call, wanted) CHECK_THAT((call) == (wanted), "%s", err.message)

#define TILE CHECKPOINT_TILE_BYTES
#define ARRAYS 3

/* Three arrays: five tiles and a bit, a few bytes, none. */
static inline void state_init(struct state_array array[ARRAYS]) {
    array[0] = (struct state_array){"texture", mem_calloc(5 * TILE + 12, 1), 5 * TILE + 12, 1};
    array[1] = (struct state_array){"counter", mem_calloc(8, 1), 8, 1};
    array[2] = (struct state_array){"empty", mem_calloc(1, 1), 0, 1};
}

static inline void state_release(struct state_array array[ARRAYS]) {
    for (int i = 0; i < ARRAYS; i++)
        mem_free(array[i].data);
}

/* The state after iteration `k`: every byte follows from k. */
static inline void state_set(struct state_array array[ARRAYS], long k) {
    for (int i = 0; i < ARRAYS; i++)
        for (size_t at = 0; at < array[i].bytes / 4; at++)
            ((uint32_t *)array[i].data)[at] = (uint32_t)at * 2654435761u + (uint32_t)k * 40503u;
}

static inline bool state_is(struct state_array array[ARRAYS], long k) {
    struct state_array wanted[ARRAYS];
    state_init(wanted);
    state_set(wanted, k);
    bool same = true;
    for (int i = 0; i < ARRAYS; i++)
        same = same && memcmp(wanted[i].data, array[i].data, array[i].bytes) == 0;
    state_release(wanted);
    return same;
}

static inline char *fresh_dir(void) {
    char *dir = mem_strdup("/tmp/unbake-test-checkpoint-XXXXXX");
    if (!mkdtemp(dir))
        exit(1);
    return dir;
}

/* Opens and loads: the iteration found, or -1 with the note for none. The content must be that
 * iteration's. */
static inline long load_from(const char *path, char note[512]) {
    struct checkpoint *c;
    struct state_array array[ARRAYS];
    bool found = false;
    long iteration = -1;
    state_init(array);
    OK(checkpoint_open(&c, path, "scene+settings", note, &err));
    if (c) {
        OK(checkpoint_load(c, array, ARRAYS, &found, &iteration, &err));
        CHECK(!found || state_is(array, iteration));
        checkpoint_close(c);
    }
    state_release(array);
    return found ? iteration : -1;
}

static inline void save_iteration(const char *path, long k) {
    struct checkpoint *c;
    struct state_array array[ARRAYS];
    char note[512];
    state_init(array);
    state_set(array, k);
    OK(checkpoint_open(&c, path, "scene+settings", note, &err));
    OK(checkpoint_save(c, k, array, ARRAYS, NULL, &err));
    checkpoint_close(c);
    state_release(array);
}

#endif
