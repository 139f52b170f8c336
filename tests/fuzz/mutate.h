/* mutate.h -- feeds a parser with damaged copies of good and bad files.
 *
 * A fuzz program is a target (a function that parses bytes and must survive any) and a corpus:
 *
 *     static void target(const uint8_t *data, size_t size) { ... }
 *     int main(int argc, char **argv) {
 *         struct mutate m;
 *         mutate_init(&m);
 *         mutate_add(&m, "vectors/png-suite", ".png");
 *         return mutate_run(&m, argc, argv, 4000, target);
 *     }
 *
 * Run plainly, it parses every seed and then the same 4000 mutants each time. FUZZ_SECONDS=n goes
 * on for n seconds instead, FUZZ_SEED=n takes another sequence, and file names as arguments are
 * parsed as they are. A case that crashes, or takes longer than a minute, is written to
 * $UNBAKE_BUILD/crash-PROGRAM before the program dies. */
#ifndef UNBAKE_TESTS_FUZZ_MUTATE_H
#define UNBAKE_TESTS_FUZZ_MUTATE_H

#include <dirent.h>
#include <fcntl.h>
#include <signal.h>
#include <stdbool.h>
#include <stdint.h>
#include <sys/stat.h>
#include <time.h>

#include "common/rng.h"
#include "tests/check.h"

/* Larger files only slow the search down. */
#define MUTATE_MAX_SEED ((size_t)32 << 10)
#define MUTATE_MAX_SEEDS 2048

struct mutate_seed {
    uint8_t *data;
    size_t size;
};

struct mutate {
    struct mutate_seed seed[MUTATE_MAX_SEEDS];
    size_t seed_count;
    uint64_t random;
    uint8_t *data; /* the case, with room for twice the largest seed */
    size_t size;
};

/* What the crash handler writes, and where to. */
static const uint8_t *mutate_case;
static size_t mutate_case_size;
static char mutate_crash_path[512];

static void mutate_save_case(void) {
    int fd = open(mutate_crash_path, O_WRONLY | O_CREAT | O_TRUNC, 0644);
    if (fd < 0)
        return;
    ssize_t wrote = write(fd, mutate_case, mutate_case_size);
    (void)wrote;
    close(fd);
    static const char note[] = "the case is kept in ";
    wrote = write(2, note, sizeof note - 1);
    wrote = write(2, mutate_crash_path, strlen(mutate_crash_path));
    wrote = write(2, "\n", 1);
}

static void mutate_on_signal(int number) {
    mutate_save_case();
    signal(number, SIG_DFL);
    raise(number);
}

/* The sanitizers' runtime has it; without them it is absent. */
extern void __sanitizer_set_death_callback(void (*callback)(void)) __attribute__((weak));

static inline void mutate_init(struct mutate *m) {
    memset(m, 0, sizeof *m);
    m->data = malloc(2 * MUTATE_MAX_SEED);
    mutate_case = m->data;
}

/* Adds bytes as a seed. */
static inline void mutate_add_bytes(struct mutate *m, const void *data, size_t size) {
    if (size > MUTATE_MAX_SEED || m->seed_count == MUTATE_MAX_SEEDS)
        return;
    struct mutate_seed *seed = &m->seed[m->seed_count++];
    seed->data = malloc(size ? size : 1);
    memcpy(seed->data, data, size);
    seed->size = size;
}

static inline size_t mutate_load(const char *path, uint8_t *data, size_t capacity) {
    FILE *file = fopen(path, "rb");
    size_t size = file ? fread(data, 1, capacity, file) : 0;
    if (file)
        fclose(file);
    return size;
}

static inline int mutate_skip_hidden(const struct dirent *entry) {
    return entry->d_name[0] != '.';
}

/* Adds the file or, recursively, the folder at `path`; only names that end in `suffix`. */
static inline void mutate_add_path(struct mutate *m, const char *path, const char *suffix) {
    struct stat facts;
    if (stat(path, &facts) != 0)
        return;
    if (S_ISREG(facts.st_mode)) {
        size_t length = strlen(path), tail = strlen(suffix);
        if (facts.st_size <= (off_t)MUTATE_MAX_SEED && length >= tail &&
            strcmp(path + length - tail, suffix) == 0)
            mutate_add_bytes(m, m->data, mutate_load(path, m->data, MUTATE_MAX_SEED));
        return;
    }
    /* In alphabetical order: the same sequence on every file system. */
    struct dirent **entry = NULL;
    int count = scandir(path, &entry, mutate_skip_hidden, alphasort);
    for (int i = 0; i < count; i++) {
        char inner[1024];
        snprintf(inner, sizeof inner, "%s/%s", path, entry[i]->d_name);
        mutate_add_path(m, inner, suffix);
        free(entry[i]);
    }
    free(entry);
}

/* The same for shared test data; absent data adds nothing. */
static inline void mutate_add(struct mutate *m, const char *name, const char *suffix) {
    const char *root = getenv("UNBAKE_TEST_DATA");
    char path[1024];
    snprintf(path, sizeof path, "%s/%s", root ? root : "../shared/data", name);
    mutate_add_path(m, path, suffix);
}

/* A number in [0, bound). */
static inline size_t mutate_below(struct mutate *m, size_t bound) {
    uint64_t bits = rng_mix64(m->random++);
    return bound ? (size_t)(bits % bound) : 0;
}

/* Moves the tail so that `remove` bytes at `at` become `insert` bytes; false when too large. */
static inline bool mutate_splice(struct mutate *m, size_t at, size_t remove, size_t insert) {
    if (m->size - remove + insert > 2 * MUTATE_MAX_SEED)
        return false;
    memmove(m->data + at + insert, m->data + at + remove, m->size - at - remove);
    m->size = m->size - remove + insert;
    return true;
}

/* Overwrites 1, 2, 4 or 8 bytes with a number that parsers trip over, in either byte order. */
static inline void mutate_number(struct mutate *m, size_t at) {
    static const uint64_t odd[] = {0, 1, 2, 7, 16, 32, 64, 100, 127, 128, 255, 256, 1024, 4096,
                                   32767, 32768, 65535, 65536, 0x7fffffff, 0x80000000, 0xffffffff,
                                   0x7fffffffffffffff, UINT64_MAX, UINT64_MAX - 1};
    size_t width = (size_t)1 << mutate_below(m, 4);
    uint64_t value = odd[mutate_below(m, sizeof odd / sizeof odd[0])];
    bool big = mutate_below(m, 2) == 0;
    for (size_t i = 0; i < width && at + i < m->size; i++)
        m->data[at + i] = (uint8_t)(value >> 8 * (big ? width - 1 - i : i));
}

static inline void mutate_once(struct mutate *m) {
    size_t at = mutate_below(m, m->size), left = m->size - at;
    size_t span = 1 + mutate_below(m, left < 64 ? left : 64);
    if (left == 0)
        return;
    if (span > left)
        span = left;
    const struct mutate_seed *other = &m->seed[mutate_below(m, m->seed_count)];
    switch (mutate_below(m, 9)) {
    case 0: m->data[at] ^= (uint8_t)(1u << mutate_below(m, 8)); break;
    case 1: m->data[at] = (uint8_t)mutate_below(m, 256); break;
    case 2:
    case 3: mutate_number(m, at); break;
    case 4: m->data[at] = (uint8_t)(m->data[at] + mutate_below(m, 5) - 2); break;
    case 5: mutate_splice(m, at, span, 0); break;
    case 6: /* a piece twice */
        if (mutate_splice(m, at, 0, span))
            memmove(m->data + at, m->data + at + span, span);
        break;
    case 7: /* a piece of another seed, or of this one */
        if (other->size >= span)
            memcpy(m->data + at, other->data + mutate_below(m, other->size - span + 1), span);
        break;
    default: /* cut short, now and then */
        if (mutate_below(m, 4) == 0)
            m->size = at;
        else
            memset(m->data + at, (int)mutate_below(m, 2) * 255, span);
    }
}

static inline void mutate_try(struct mutate *m, void (*target)(const uint8_t *, size_t)) {
    /* A copy of its exact size, for a sanitizer to see one byte too many. */
    uint8_t *exact = malloc(m->size ? m->size : 1);
    memcpy(exact, m->data, m->size);
    mutate_case_size = m->size;
    alarm(60);
    target(exact, m->size);
    alarm(0);
    free(exact);
}

static inline void mutate_guard(const char *program) {
    const char *build = getenv("UNBAKE_BUILD"), *slash = strrchr(program, '/');
    snprintf(mutate_crash_path, sizeof mutate_crash_path, "%s/crash-%s", build ? build : "build",
             slash ? slash + 1 : program);
    signal(SIGALRM, mutate_on_signal);
    if (__sanitizer_set_death_callback) {
        __sanitizer_set_death_callback(mutate_save_case);
        return;
    }
    static const int fatal[] = {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT};
    for (size_t i = 0; i < sizeof fatal / sizeof fatal[0]; i++)
        signal(fatal[i], mutate_on_signal);
}

/* Runs as described above; returns the program's exit status. Frees the seeds. */
static inline int mutate_run(struct mutate *m, int argc, char **argv, long count,
                             void (*target)(const uint8_t *, size_t)) {
    const char *seconds = getenv("FUZZ_SECONDS"), *sequence = getenv("FUZZ_SEED");
    mutate_guard(argv[0]);
    m->random = sequence ? rng_mix64(strtoull(sequence, NULL, 10)) : 0;
    long done = 0;
    if (argc > 1) {
        for (int i = 1; i < argc; i++, done++) {
            m->size = mutate_load(argv[i], m->data, 2 * MUTATE_MAX_SEED);
            mutate_try(m, target);
        }
    } else if (m->seed_count > 0) {
        time_t end = time(NULL) + (seconds ? atol(seconds) : 0);
        for (long i = 0; seconds ? time(NULL) < end : i < count + (long)m->seed_count; i++, done++) {
            bool plain = i < (long)m->seed_count;
            const struct mutate_seed *seed =
                &m->seed[plain ? (size_t)i : mutate_below(m, m->seed_count)];
            memcpy(m->data, seed->data, seed->size);
            m->size = seed->size;
            for (size_t k = plain ? 0 : 1 + mutate_below(m, 6); k > 0; k--)
                mutate_once(m);
            mutate_try(m, target);
        }
    }
    printf("%ld executions from %zu seeds\n", done, m->seed_count);
    size_t seed_count = m->seed_count;
    for (size_t i = 0; i < m->seed_count; i++)
        free(m->seed[i].data);
    free(m->data);
    m->seed_count = 0;
    if (seed_count == 0 && argc == 1)
        CHECK_SKIP("no seeds: the test data is not here");
    return check_result();
}

#endif
