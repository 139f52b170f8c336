/* driver.c -- runs a fuzz target without libFuzzer: every seed, and the same mutants of them each
 * time.
 *
 *   test_NAME              as a test
 *   test_NAME FILE...      these inputs
 *   test_NAME --seeds DIR  writes the seeds into DIR, for libFuzzer
 *
 * An input that crashes, or takes longer than a minute, is kept as $UNBAKE_BUILD/crash-NAME. */
#include <fcntl.h>
#include <signal.h>
#include <unistd.h>

#include "common/rng.h"
#include "tests/fuzz/fuzz.h"

struct mutant {
    uint64_t random;
    uint8_t data[2 * SEED_MAX_BYTES];
    size_t size;
};

/* --- what a crash leaves ------------------------------------------------------------------- */

static const uint8_t *input;
static size_t input_size;
static char crash_path[512];

static void keep_input(void) {
    static const char note[] = "the input is kept in ";
    int fd = open(crash_path, O_WRONLY | O_CREAT | O_TRUNC, 0644);
    if (fd < 0 || write(fd, input, input_size) < 0 || write(2, note, sizeof note - 1) < 0 ||
        write(2, crash_path, strlen(crash_path)) < 0 || write(2, "\n", 1) < 0)
        return; /* the program dies anyway */
    close(fd);
}

static void on_signal(int number) {
    keep_input();
    signal(number, SIG_DFL);
    raise(number);
}

/* The sanitizers' runtime has it; without them it is absent. */
extern void __sanitizer_set_death_callback(void (*callback)(void)) __attribute__((weak));

static void watch_for_crashes(const char *name) {
    static const int fatal[] = {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT};
    const char *build = getenv("UNBAKE_BUILD");
    snprintf(crash_path, sizeof crash_path, "%s/crash-%s", build ? build : "build", name);
    signal(SIGALRM, on_signal);
    if (__sanitizer_set_death_callback)
        __sanitizer_set_death_callback(keep_input);
    for (size_t i = 0; i < sizeof fatal / sizeof fatal[0]; i++)
        if (!__sanitizer_set_death_callback || fatal[i] == SIGABRT)
            signal(fatal[i], on_signal);
}

/* --- mutation ------------------------------------------------------------------------------ */

/* A number in [0, bound). */
static size_t below(struct mutant *m, size_t bound) {
    uint64_t bits = rng_mix64(m->random++);
    return bound ? (size_t)(bits % bound) : 0;
}

/* Moves the tail so that `removed` bytes at `at` become `inserted`; false when that is too large. */
static bool move_tail(struct mutant *m, size_t at, size_t removed, size_t inserted) {
    if (m->size - removed + inserted > sizeof m->data)
        return false;
    memmove(m->data + at + inserted, m->data + at + removed, m->size - at - removed);
    m->size = m->size - removed + inserted;
    return true;
}

/* Overwrites 1, 2, 4 or 8 bytes with a number that parsers trip over, in either byte order. */
static void put_number(struct mutant *m, size_t at) {
    static const uint64_t odd[] = {0,          1,
                                   2,          7,
                                   16,         32,
                                   64,         100,
                                   127,        128,
                                   255,        256,
                                   1024,       4096,
                                   32767,      32768,
                                   65535,      65536,
                                   0x7fffffff, 0x80000000,
                                   0xffffffff, 0x7fffffffffffffff,
                                   UINT64_MAX, UINT64_MAX - 1};
    size_t width = (size_t)1 << below(m, 4);
    uint64_t value = odd[below(m, sizeof odd / sizeof odd[0])];
    bool big = below(m, 2) == 0;
    for (size_t i = 0; i < width && at + i < m->size; i++)
        m->data[at + i] = (uint8_t)(value >> 8 * (big ? width - 1 - i : i));
}

static void mutate(struct mutant *m, const struct seeds *s) {
    size_t at = below(m, m->size), left = m->size - at;
    if (left == 0)
        return;
    size_t span = 1 + below(m, left < 64 ? left : 64);
    const struct seed *other = &s->seed[below(m, s->count)];
    switch (below(m, 9)) {
    case 0: m->data[at] ^= (uint8_t)(1u << below(m, 8)); break;
    case 1: m->data[at] = (uint8_t)below(m, 256); break;
    case 2:
    case 3: put_number(m, at); break;
    case 4: m->data[at] = (uint8_t)(m->data[at] + below(m, 5) - 2); break;
    case 5: move_tail(m, at, span, 0); break;
    case 6: /* a piece twice */
        if (move_tail(m, at, 0, span))
            memmove(m->data + at, m->data + at + span, span);
        break;
    case 7: /* a piece of another seed, or of this one */
        if (other->size >= span)
            memcpy(m->data + at, other->data + below(m, other->size - span + 1), span);
        break;
    default: /* cut short, now and then */
        if (below(m, 4) == 0)
            m->size = at;
        else
            memset(m->data + at, (int)below(m, 2) * 255, span);
    }
}

/* --- running ------------------------------------------------------------------------------- */

static void try(const uint8_t *data, size_t size) {
    /* A copy of its exact size, for a sanitizer to see one byte too many. */
    uint8_t *exact = malloc(size ? size : 1);
    memcpy(exact, data, size);
    input = exact;
    input_size = size;
    alarm(60);
    LLVMFuzzerTestOneInput(exact, size);
    alarm(0);
    free(exact);
}

static void run(const struct seeds *s) {
    static struct mutant m;
    for (size_t i = 0; i < s->count; i++)
        try(s->seed[i].data, s->seed[i].size);
    for (long i = 0; i < s->mutants && s->count > 0; i++) {
        const struct seed *seed = &s->seed[below(&m, s->count)];
        memcpy(m.data, seed->data, seed->size);
        m.size = seed->size;
        for (size_t k = 1 + below(&m, 6); k > 0; k--)
            mutate(&m, s);
        try(m.data, m.size);
    }
    printf("%zu seeds, %ld mutants\n", s->count, s->mutants);
}

int main(int argc, char **argv) {
    struct seeds s = {0};
    const char *slash = strrchr(argv[0], '/'), *name = slash ? slash + 1 : argv[0];
    bool writes = argc == 3 && strcmp(argv[1], "--seeds") == 0;
    char path[1024];
    watch_for_crashes(name);
    if (argc > 1 && !writes) {
        for (int i = 1; i < argc; i++)
            seeds_path(&s, argv[i], "");
    } else {
        snprintf(path, sizeof path, "tests/fuzz/seeds/%s", name + strlen("test_"));
        seeds_path(&s, path, "");
        fuzz_seeds(&s);
    }
    for (size_t i = 0; i < s.count && writes; i++) {
        snprintf(path, sizeof path, "%s/%05zu", argv[2], i);
        fuzz_write(path, s.seed[i].data, s.seed[i].size);
    }
    if (!writes)
        run(&s);
    size_t count = s.count;
    seeds_release(&s);
    if (count == 0)
        printf("no seeds: the test data is not here\n");
    return count == 0 ? 77 : 0;
}
