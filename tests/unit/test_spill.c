/* spill.h: what fits the budget is in memory, else in a file without a name; contents survive being unmapped; no more
 * than the budget is mapped, at any moment where readers tell what they look at, else soon after; a full disk is an
 * error of the reservation. */
#include "common/spill.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdbool.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <time.h>

#include "common/file.h"
#include "common/mem.h"
#include "common/parallel.h"
#include "common/rng.h"
#include "tests/check.h"

#define MIB ((size_t)1 << 20)
#define BUDGET (4 * MIB)
#define ARRAYS 6
#define ARRAY (4 * MIB)
/* Pages around one that is touched are mapped with it, and the kernel counts a process's pages in batches. */
#define SLACK (3 * MIB)

static char dir[64];
static struct error err;

static struct spill *new_spill(uint64_t keep_free, uint64_t limit) {
    return spill_new(dir, &(struct spill_limits){BUDGET, keep_free, limit});
}

/* Bytes of files that this process has mapped and touched. */
static size_t mapped(void) {
    unsigned long all, resident, of_files = 0;
    FILE *file = fopen("/proc/self/statm", "re");
    CHECK(file && fscanf(file, "%lu %lu %lu", &all, &resident, &of_files) == 3);
    if (file)
        fclose(file);
    return of_files * (size_t)sysconf(_SC_PAGESIZE);
}

/* What is left once the keeper has looked, which a busy machine or disk may hold up: looked at for ten seconds, until
 * it is no more than `most`. */
static size_t mapped_soon(size_t most) {
    size_t now = mapped();
    for (int i = 0; i < 1000 && now > most; i++) {
        nanosleep(&(struct timespec){.tv_nsec = 10 * 1000 * 1000}, NULL);
        now = mapped();
    }
    return now;
}

/* Until the keeper may have looked. */
static void wait_for_keeper(void) { nanosleep(&(struct timespec){.tv_nsec = 100 * 1000 * 1000}, NULL); }

static void test_memory(void) {
    struct spill *s = new_spill(0, 0);
    CHECK(spill_reserve(s, "they", 2, 2 * MIB, 2 * MIB, &err) == STATUS_OK);
    char *a = spill_take(s, MIB, 1), *b = spill_take(s, MIB / 4, 4);
    memset(a, 1, MIB);
    memset(b, 2, MIB);
    CHECK(spill_file_bytes(s) == 0);
    wait_for_keeper();
    CHECK(a[MIB - 1] == 1 && b[0] == 2);
    /* These no longer fit beside them. */
    CHECK(spill_reserve(s, "they", 1, 3 * MIB, 0, &err) == STATUS_OK);
    CHECK(spill_file_bytes(s) >= 3 * MIB);
    char *c = spill_take(s, 3 * MIB, 1);
    c[3 * MIB - 1] = 3;
    spill_give(s, c);
    CHECK_THAT(spill_file_bytes(s) < MIB, "%llu bytes are not given back", (unsigned long long)spill_file_bytes(s));
    spill_give(s, a);
    /* What is given back makes room. */
    CHECK(spill_reserve(s, "they", 1, 3 * MIB, 0, &err) == STATUS_OK);
    CHECK(spill_file_bytes(s) < MIB);
    spill_give(s, b);
    spill_give(s, mem_alloc(1)); /* of elsewhere */
    spill_give(s, NULL);
    spill_free(s);
    spill_give(NULL, spill_take(NULL, 3, 5));
    CHECK(spill_reserve(NULL, "they", 1, 1, 1, &err) == STATUS_OK && spill_file_bytes(NULL) == 0);
    spill_free(NULL);
}

/* Space of the disk that open files without a name in `dir` have. */
static uint64_t allocated(void) {
    uint64_t bytes = 0;
    DIR *folder = opendir("/proc/self/fd");
    const struct dirent *entry;
    while (folder && (entry = readdir(folder)) != NULL) {
        char link[300], target[512];
        struct stat info;
        snprintf(link, sizeof link, "/proc/self/fd/%s", entry->d_name);
        ssize_t length = readlink(link, target, sizeof target - 1);
        target[length > 0 ? length : 0] = '\0';
        if (strncmp(target, dir, strlen(dir)) == 0 && stat(link, &info) == 0)
            bytes += (uint64_t)info.st_blocks * 512;
    }
    closedir(folder);
    return bytes;
}

/* What follows later is part of the decision. */
static void test_later(void) {
    struct spill *s = new_spill(0, 0);
    CHECK(spill_reserve(s, "they", 1, MIB, BUDGET, &err) == STATUS_OK);
    CHECK(spill_file_bytes(s) >= MIB);
    CHECK_THAT(allocated() >= MIB, "what is reserved is not allocated: a full disk is a signal at a later store");
    spill_free(s);
    CHECK(allocated() == 0);
}

static bool holds(const uint32_t *array, uint32_t of) {
    for (size_t i = 0; i < ARRAY / 4; i++)
        if (array[i] != (uint32_t)i * of)
            return false;
    return true;
}

static void test_file(void) {
    uint32_t *array[ARRAYS];
    struct spill *s = new_spill(0, 0);
    CHECK(spill_reserve(s, "they", ARRAYS, ARRAYS * ARRAY, 0, &err) == STATUS_OK);
    size_t before = mapped(), most = 0;
    for (uint32_t k = 0; k < ARRAYS; k++) {
        array[k] = spill_take(s, ARRAY / 4, 4);
        for (uint32_t i = 0; i < ARRAY / 4; i++)
            array[k][i] = i * (k + 1);
        size_t now = mapped_soon(before + BUDGET + SLACK);
        most = now > most ? now : most;
    }
    CHECK_THAT(most <= before + BUDGET + SLACK, "%zu KiB are mapped", (most - before) / 1024);
    for (uint32_t round = 0; round < 2; round++) {
        for (uint32_t k = 0; k < ARRAYS; k++) {
            CHECK(holds(array[k], k + 1));
            size_t now = mapped_soon(before + BUDGET + SLACK);
            most = now > most ? now : most;
        }
    }
    CHECK_THAT(most <= before + BUDGET + SLACK, "%zu KiB are mapped", (most - before) / 1024);
    /* Nobody sees it, so nobody has to tidy up. */
    DIR *folder = opendir(dir);
    size_t names = 0;
    while (folder && readdir(folder))
        names++;
    CHECK(names == 2); /* . and .. */
    closedir(folder);
    for (uint32_t k = 0; k < ARRAYS; k++)
        spill_give(s, array[k]);
    spill_free(s);
}

/* --- random access ---------------------------------------------------------------------------------- */

#define LOOKUPS 5000 /* of a body */
#define BODIES 8
#define EACH 64 /* look-ups between two measurements */

struct lookups {
    struct spill *s;
    uint32_t *array[ARRAYS];
    size_t most[BODIES];
    bool held[BODIES];
};

/* Reads and writes single words all over the arrays, each word by one body only. */
static void look_up(void *user, size_t body, int thread) {
    struct lookups *l = user;
    (void)thread;
    l->held[body] = true;
    for (uint32_t i = 0; i < LOOKUPS; i++) {
        uint64_t bits = rng_key(body, i, 0);
        uint32_t k = (uint32_t)(bits % ARRAYS);
        size_t word = (size_t)(bits >> 16) % (ARRAY / 4 / BODIES) * BODIES + body;
        uint32_t *at = &l->array[k][word];
        spill_use(l->s, at, sizeof *at);
        l->held[body] = l->held[body] && (*at == (uint32_t)word * (k + 1) || *at == (uint32_t)word * (k + 1) + 1);
        *at = (uint32_t)word * (k + 1) + 1;
        size_t now = i % EACH == 0 ? mapped() : 0;
        l->most[body] = now > l->most[body] ? now : l->most[body];
    }
}

static void test_random(void) {
    struct lookups l = {.s = new_spill(0, 0)};
    struct parallel *pool = parallel_new(3);
    CHECK(!spill_has_file(l.s) && !spill_has_file(NULL));
    CHECK(spill_reserve(l.s, "they", ARRAYS, ARRAYS * ARRAY, 0, &err) == STATUS_OK);
    CHECK(spill_has_file(l.s));
    size_t before = mapped(), most = 0;
    for (uint32_t k = 0; k < ARRAYS; k++) {
        l.array[k] = spill_take(l.s, ARRAY / 4, 4);
        for (uint32_t i = 0; i < ARRAY / 4; i++) {
            spill_use(l.s, &l.array[k][i], 4);
            l.array[k][i] = i * (k + 1);
        }
    }
    parallel_for(pool, BODIES, look_up, &l);
    for (size_t i = 0; i < BODIES; i++) {
        CHECK(l.held[i]);
        most = l.most[i] > most ? l.most[i] : most;
    }
    CHECK_THAT(most <= before + BUDGET + BUDGET / 4, "%zu KiB are mapped, of a budget of %zu", (most - before) / 1024,
               BUDGET / 1024);
    CHECK_THAT(most >= before + BUDGET / 2, "only %zu KiB are mapped, of a budget of %zu", (most - before) / 1024,
               BUDGET / 1024);
    /* A freed one is no memory any more, as after free() of a large block; and one in memory. */
    int null = open("/dev/zero", O_RDONLY | O_CLOEXEC);
    spill_give(l.s, l.array[0]);
    CHECK(read(null, l.array[0], 1) == -1 && errno == EFAULT);
    close(null);
    l.array[0] = spill_take(NULL, 1, 4);
    spill_use(l.s, l.array[0], 4);
    spill_use(NULL, l.array[0], 4);
    for (uint32_t k = 0; k < ARRAYS; k++)
        spill_give(l.s, l.array[k]);
    spill_free(l.s);
    parallel_free(pool);
}

/* Readers of what is in memory may be at work while the file begins: for the thread sanitizer. */
static void begin_or_use(void *user, size_t body, int thread) {
    struct lookups *l = user;
    (void)thread;
    if (body == 0)
        l->held[0] = spill_reserve(l->s, "they", 1, ARRAY, 0, NULL) == STATUS_OK;
    for (int i = 0; i < 1000 && body > 0; i++) {
        spill_use(l->s, l->array[0], 4);
        l->held[body] = !spill_has_file(l->s) || l->held[body];
    }
}

static void test_begin(void) {
    struct lookups l = {.s = new_spill(0, 0)};
    struct parallel *pool = parallel_new(3);
    l.array[0] = spill_take(l.s, 1, 4);
    parallel_for(pool, BODIES, begin_or_use, &l);
    CHECK(l.held[0] && spill_has_file(l.s));
    spill_give(l.s, l.array[0]);
    spill_free(l.s);
    parallel_free(pool);
}

static void test_limits(void) {
    struct spill *s = new_spill(0, 8 * MIB);
    CHECK(spill_reserve(s, "they", 1, 6 * MIB, 0, &err) == STATUS_OK);
    CHECK(spill_reserve(s, "the others", 1, 6 * MIB, 0, &err) == STATUS_NO_SPACE);
    CHECK_THAT(strstr(err.message, "the others take 6 MiB") && *err.hint, "%s", err.message);
    spill_free(s);

    s = new_spill((uint64_t)1 << 60, 0);
    CHECK(spill_reserve(s, "they", 1, 6 * MIB, 0, &err) == STATUS_NO_SPACE);
    CHECK_THAT(strstr(err.message, "they do not fit the memory") && *err.hint, "%s", err.message);
    CHECK(spill_file_bytes(s) == 0);
    spill_free(s);
}

/* A file that may not grow stands for a disk that is full. */
static void test_full(void) {
    struct rlimit before, small;
    getrlimit(RLIMIT_FSIZE, &before);
    small = before;
    small.rlim_cur = 16 * MIB;
    signal(SIGXFSZ, SIG_IGN);
    struct spill *s = new_spill(0, 0);
    CHECK(setrlimit(RLIMIT_FSIZE, &small) == 0);
    CHECK(spill_reserve(s, "they", 1, 64 * MIB, 0, &err) == STATUS_NO_SPACE);
    CHECK_THAT(strstr(err.message, "they do not fit the memory, and the disk has no 64 MiB"), "%s", err.message);
    CHECK(spill_file_bytes(s) == 0);
    /* Less goes on. */
    CHECK(spill_reserve(s, "they", 1, 6 * MIB, 0, &err) == STATUS_OK);
    char *a = spill_take(s, 6 * MIB, 1);
    memset(a, 7, 6 * MIB);
    wait_for_keeper();
    CHECK(a[6 * MIB - 1] == 7);
    spill_give(s, a);
    spill_free(s);
    setrlimit(RLIMIT_FSIZE, &before);

    s = spill_new("/nowhere/at/all", &(struct spill_limits){.memory_bytes = 1});
    CHECK(spill_reserve(s, "they", 1, MIB, 0, &err) == STATUS_NOT_FOUND && strstr(err.message, "/nowhere"));
    spill_free(s);
}

int main(void) {
    snprintf(dir, sizeof dir, "%s/unbake-spill-XXXXXX", check_fast_dir());
    if (!mkdtemp(dir))
        return 1;
    test_memory();
    test_later();
    test_file();
    test_random();
    test_begin();
    test_limits();
    test_full();
    CHECK(file_remove_tree(dir, &err) == STATUS_OK);
    return check_result();
}
