/* test_checkpoint.c -- checkpoint.db: what is saved comes back, the unchanged is not written
 * again, damage is found, a full disk or a kill leaves the one before. UNBAKE_KILLS sets the
 * number of kills (15). */
#include "server/worker/checkpoint.h"
#include "server/worker/checkpoint_file.h"

#include <fcntl.h>
#include <signal.h>
#include <sqlite3.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>

#include "common/file.h"
#include "common/hash64.h"
#include "common/mem.h"
#include "common/protocol.h"
#include "tests/check.h"

static struct error err;

#define OK(call) CHECK_THAT((call) == STATUS_OK, "%s", err.message)
#define IS(call, wanted) CHECK_THAT((call) == (wanted), "%s", err.message)

#define TILE CHECKPOINT_TILE_BYTES
#define ARRAYS 3

/* Three arrays: five tiles and a bit, a few bytes, none. */
static void state_init(struct state_array array[ARRAYS]) {
    array[0] = (struct state_array){"texture", mem_calloc(5 * TILE + 12, 1), 5 * TILE + 12, 1};
    array[1] = (struct state_array){"counter", mem_calloc(8, 1), 8, 1};
    array[2] = (struct state_array){"empty", mem_calloc(1, 1), 0, 1};
}

static void state_release(struct state_array array[ARRAYS]) {
    for (int i = 0; i < ARRAYS; i++)
        mem_free(array[i].data);
}

/* The state after iteration `k`: every byte follows from k. */
static void state_set(struct state_array array[ARRAYS], long k) {
    for (int i = 0; i < ARRAYS; i++)
        for (size_t at = 0; at < array[i].bytes / 4; at++)
            ((uint32_t *)array[i].data)[at] = (uint32_t)at * 2654435761u + (uint32_t)k * 40503u;
}

static bool state_is(struct state_array array[ARRAYS], long k) {
    struct state_array wanted[ARRAYS];
    state_init(wanted);
    state_set(wanted, k);
    bool same = true;
    for (int i = 0; i < ARRAYS; i++)
        same = same && memcmp(wanted[i].data, array[i].data, array[i].bytes) == 0;
    state_release(wanted);
    return same;
}

static char *fresh_dir(void) {
    char *dir = mem_strdup("/tmp/unbake-test-checkpoint-XXXXXX");
    if (!mkdtemp(dir))
        exit(1);
    return dir;
}

/* Opens and loads: the iteration found, or -1 with the note for none. The content must be that
 * iteration's. */
static long load_from(const char *path, char note[512]) {
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

static void test_hash(void) {
    /* Published values of XXH64. */
    CHECK(hash64("", 0, 0) == 0xEF46DB3751D8E999u);
    CHECK(hash64("a", 1, 0) == 0xD24EC4F1A98C6E5Bu);
    CHECK(hash64("abc", 3, 0) == 0x44BC2CF5AD770999u);
    static const char text[] = "Nobody inspects the spammish repetition";
    CHECK(hash64(text, strlen(text), 0) == 0xFBCEA83C8A378BF1u);
}

/* What changed is written, and nothing else; `loaded` is the state at the end. */
static void test_round_trip(const char *path, struct state_array *loaded) {
    struct checkpoint *c, *second;
    struct state_array array[ARRAYS];
    struct checkpoint_cost cost;
    char note[512];
    bool found = true;
    long iteration = -1;
    state_init(array);
    OK(checkpoint_open(&c, path, "scene+settings", note, &err));
    CHECK(note[0] == '\0');
    OK(checkpoint_load(c, array, ARRAYS, &found, &iteration, &err));
    CHECK(!found);
    state_set(array, 1);
    OK(checkpoint_save(c, 1, array, ARRAYS, &cost, &err));
    CHECK(cost.tile_count == 7 && cost.written_tile_count == 7);
    CHECK(cost.written_bytes == 5 * TILE + 12 + 8);

    /* Nothing changed, then one byte. */
    OK(checkpoint_save(c, 2, array, ARRAYS, &cost, &err));
    CHECK(cost.written_tile_count == 0);
    ((char *)array[0].data)[3 * TILE] ^= 1;
    OK(checkpoint_save(c, 3, array, ARRAYS, &cost, &err));
    CHECK(cost.written_tile_count == 1 && cost.written_bytes == TILE);

    /* Another process (or connection) cannot have it. */
    IS(checkpoint_open(&second, path, "scene+settings", note, &err), STATUS_UNAVAILABLE);
    checkpoint_close(c);

    /* Hashes survive the process: after a load nothing is written again. */
    OK(checkpoint_open(&c, path, "scene+settings", note, &err));
    state_init(loaded);
    OK(checkpoint_load(c, loaded, ARRAYS, &found, &iteration, &err));
    CHECK(found && iteration == 3);
    CHECK(memcmp(loaded[0].data, array[0].data, array[0].bytes) == 0);
    OK(checkpoint_save(c, 4, loaded, ARRAYS, &cost, &err));
    CHECK(cost.written_tile_count == 0);

    /* The file does not grow without end. */
    struct stat info;
    for (long k = 5; k < 12; k++) {
        state_set(loaded, k);
        OK(checkpoint_save(c, k, loaded, ARRAYS, &cost, &err));
        CHECK(cost.written_tile_count == 7);
    }
    CHECK(stat(path, &info) == 0);
    CHECK_THAT(info.st_size < (off_t)(14 * TILE), "%ld bytes", (long)info.st_size);
    checkpoint_close(c);
    state_release(array);
}

/* Other arrays, and other settings. */
static void test_others(const char *path, struct state_array *loaded) {
    struct checkpoint *c;
    struct checkpoint_cost cost;
    char note[512];
    bool found;
    long iteration;
    OK(checkpoint_open(&c, path, "scene+settings", note, &err));

    /* Other arrays: said, nothing touched; a save replaces them. */
    loaded[1].bytes = 4;
    memset(loaded[0].data, 0x5a, loaded[0].bytes);
    IS(checkpoint_load(c, loaded, ARRAYS, &found, &iteration, &err), STATUS_CORRUPT);
    CHECK(!found && ((char *)loaded[0].data)[0] == 0x5a);
    OK(checkpoint_save(c, 20, loaded, 2, &cost, &err));
    CHECK(cost.written_tile_count == 7);
    OK(checkpoint_load(c, loaded, 2, &found, &iteration, &err));
    CHECK(found && iteration == 20);
    OK(checkpoint_clear(c, &err));
    OK(checkpoint_load(c, loaded, 2, &found, &iteration, &err));
    CHECK(!found);
    loaded[1].bytes = 8;
    state_set(loaded, 21);
    OK(checkpoint_save(c, 21, loaded, ARRAYS, &cost, &err));
    checkpoint_close(c);
    CHECK(load_from(path, note) == 21);

    /* Other settings: not used, and gone. */
    OK(checkpoint_open(&c, path, "others", note, &err));
    CHECK(strstr(note, "other settings") != NULL);
    OK(checkpoint_load(c, loaded, ARRAYS, &found, &iteration, &err));
    CHECK(!found);
    checkpoint_close(c);
    state_release(loaded);
}

static void script(const char *path, const char *text) {
    sqlite3 *db;
    CHECK(sqlite3_open(path, &db) == SQLITE_OK && sqlite3_exec(db, text, NULL, NULL, NULL) == SQLITE_OK);
    sqlite3_close(db);
}

/* Opens what `format` wrote and loads those arrays; the iteration that was found, -1 for none. */
static long load_format(const char *path, int format, struct state_array *array, size_t count, enum status wanted,
                        char note[512]) {
    struct checkpoint *c;
    bool found = false;
    long iteration = -1;
    char *text = mem_printf("PRAGMA user_version=%d", format);
    script(path, text);
    mem_free(text);
    OK(checkpoint_open(&c, path, "scene+settings", note, &err));
    IS(checkpoint_load(c, array, count, &found, &iteration, &err), wanted);
    if (found)
        snprintf(note, 512, "%s", checkpoint_note(c));
    if (found) /* the next save is of today's format */
        OK(checkpoint_save(c, iteration, array, count, NULL, &err));
    checkpoint_close(c);
    return found ? iteration : -1;
}

/* A file of the format before is read, by the names of its arrays; what is dropped of it is said; what it does not fit
 * is not used. */
static void test_format_before(const char *path) {
    struct checkpoint *c;
    uint32_t kept[3] = {1, 2, 3}, gone[2] = {4, 5}, added = 6, plan[3] = {0};
    uint64_t surface = 7;
    struct state_array old[] = {{"gone", gone, sizeof gone, 1}, {"kept", kept, sizeof kept, 1}};
    struct state_array now[] = {{"kept", plan, sizeof plan, 1},
                                {"added", &added, sizeof added, 2},
                                {STATE_SURFACE, &surface, sizeof surface, 2}};
    char note[512];
    OK(checkpoint_open(&c, path, "scene+settings", note, &err));
    OK(checkpoint_save(c, 30, old, 2, NULL, &err));
    checkpoint_close(c);
    CHECK(load_format(path, 1, now, 3, STATUS_OK, note) == 30);
    CHECK(memcmp(plan, kept, sizeof kept) == 0 && added == 6);
    CHECK_STRING(note, "dropped of the checkpoint: gone; the checkpoint is of format 1, by unbaked " UNBAKE_VERSION
                       "; the rest of it is used");
    /* That has made it one of today's. */
    OK(checkpoint_open(&c, path, "scene+settings", note, &err));
    bool found;
    long iteration;
    OK(checkpoint_load(c, now, 3, &found, &iteration, &err));
    CHECK(found && iteration == 30 && !*checkpoint_note(c));
    /* Textures that are laid over another surface would be a wrong answer. */
    surface = 8;
    IS(checkpoint_load(c, now, 3, &found, &iteration, &err), STATUS_CORRUPT);
    CHECK(!found && strstr(err.message, "another way"));
    checkpoint_close(c);
    surface = 7;
    /* What today's format has to have is missing. */
    OK(checkpoint_open(&c, path, "scene+settings", note, &err));
    OK(checkpoint_save(c, 31, now, 1, NULL, &err));
    IS(checkpoint_load(c, now, 3, &found, &iteration, &err), STATUS_CORRUPT);
    CHECK(strstr(err.message, "has no added"));
    checkpoint_close(c);
    /* One of a later program is not guessed at. */
    CHECK(load_format(path, STATE_FORMAT + 1, now, 1, STATUS_OK, note) == -1);
    CHECK(strstr(note, "reads up to"));
}

static void save_iteration(const char *path, long k) {
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

static void write_file(const char *path, const char *data, size_t length) {
    int fd = open(path, O_WRONLY | O_CREAT | O_TRUNC, 0600);
    OK(file_write_all(fd, data, length, path, &err));
    close(fd);
}

/* Flipped bits and lost ends: found, or they hit what nobody reads. */
static void test_damage(const char *path) {
    char note[512];
    save_iteration(path, 7);
    struct buf whole;
    buf_init(&whole, 64 << 20);
    OK(file_read(path, &whole, &err));
    uint32_t random = 12345;
    int found_count = 0, flips = 100;
    for (int i = 0; i < flips; i++) {
        random = random * 1664525u + 1013904223u;
        size_t at = (size_t)random % whole.length;
        if (i < 40)
            at %= 4096; /* heads and the first page's table */
        whole.data[at] ^= (char)(1 << (random >> 29));
        write_file(path, whole.data, whole.length);
        whole.data[at] ^= (char)(1 << (random >> 29));
        long iteration = load_from(path, note);
        CHECK_THAT(iteration == 7 || (iteration == -1 && note[0]), "flip at %zu: %ld", at, iteration);
        found_count += iteration == -1;
    }
    CHECK_THAT(found_count > flips / 2, "%d of %d", found_count, flips);
    for (size_t length = 0; length < whole.length; length += 65536 * 7 + 100) {
        write_file(path, whole.data, length);
        long iteration = load_from(path, note);
        CHECK_THAT(iteration == -1 && (note[0] || length == 0), "cut at %zu: %ld", length, iteration);
    }
    write_file(path, whole.data, whole.length);
    CHECK(load_from(path, note) == 7);
    buf_release(&whole);
}

/* The limit on a file's size stands for a full disk. In a child: it is the process's. */
/* The tiles are as they were said to be, but not as many, or not those, that were saved together. */
static void test_digest(const char *path) {
    char note[512];
    sqlite3 *db;
    save_iteration(path, 7);
    CHECK(sqlite3_open(path, &db) == SQLITE_OK);
    CHECK(sqlite3_exec(db, "UPDATE newest SET digest = digest + 1", NULL, NULL, NULL) == SQLITE_OK);
    sqlite3_close(db);
    CHECK(load_from(path, note) == -1);
    CHECK_THAT(strstr(note, "cannot be used") && strstr(note, "the digest of its tiles does not match"), "%s", note);
}

/* Between opening and loading the disk changes what is in the middle of each page, where there are tiles. */
static void test_read_twice(const char *path) {
    char note[512], byte;
    struct checkpoint *c;
    struct state_array array[ARRAYS];
    bool found;
    long iteration;
    state_init(array);
    save_iteration(path, 7);
    OK(checkpoint_open(&c, path, "scene+settings", note, &err));
    CHECK_THAT(!note[0], "%s", note);
    pid_t child = fork(); /* to close the file here would drop SQLite's locks */
    if (child == 0) {
        int fd = open(path, O_RDWR | O_CLOEXEC);
        for (off_t at = 30000; pread(fd, &byte, 1, at) == 1; at += 65536) {
            byte ^= 1;
            if (pwrite(fd, &byte, 1, at) != 1)
                _exit(1);
        }
        _exit(0);
    }
    int status;
    CHECK(waitpid(child, &status, 0) == child && status == 0);
    IS(checkpoint_load(c, array, ARRAYS, &found, &iteration, &err), STATUS_IO);
    CHECK_THAT(!found && strstr(err.message, "a tile read twice differs"), "%s", err.message);
    checkpoint_close(c);
    state_release(array);
    CHECK(load_from(path, note) == -1);
    CHECK_THAT(strstr(note, "cannot be used"), "%s", note);
}

static void test_full_disk(const char *path) {
    char note[512];
    save_iteration(path, 7);
    struct stat info;
    CHECK(stat(path, &info) == 0);
    pid_t child = fork();
    if (child == 0) {
        signal(SIGXFSZ, SIG_IGN);
        struct checkpoint *c;
        struct state_array array[ARRAYS];
        struct rlimit limit;
        bool found;
        long iteration;
        int full_count = 0;
        state_init(array);
        OK(checkpoint_open(&c, path, "scene+settings", note, &err));
        getrlimit(RLIMIT_FSIZE, &limit);
        for (rlim_t room = 0; room < 6 * TILE; room += TILE / 2 + 4096) {
            limit.rlim_cur = (rlim_t)info.st_size + room;
            setrlimit(RLIMIT_FSIZE, &limit);
            state_set(array, 8);
            enum status status = checkpoint_save(c, 8, array, ARRAYS, NULL, &err);
            CHECK_THAT(status == STATUS_NO_SPACE || status == STATUS_OK, "%s", err.message);
            full_count += status == STATUS_NO_SPACE;
            OK(checkpoint_load(c, array, ARRAYS, &found, &iteration, &err));
            CHECK(found && iteration == (status == STATUS_OK ? 8 : 7) && state_is(array, iteration));
            if (status == STATUS_OK)
                break;
        }
        CHECK(full_count > 5);
        limit.rlim_cur = limit.rlim_max;
        setrlimit(RLIMIT_FSIZE, &limit); /* room again: goes on */
        state_set(array, 9);
        OK(checkpoint_save(c, 9, array, ARRAYS, NULL, &err));
        checkpoint_close(c);
        state_release(array);
        _exit(check_result());
    }
    int status;
    CHECK(waitpid(child, &status, 0) == child);
    CHECK_THAT(status == 0, "wait status %x", (unsigned)status);
    CHECK(load_from(path, note) == 9);
}

/* A process saves without pause and is killed: what it had acknowledged, or newer, is there. */
static void test_kill(const char *path) {
    char note[512];
    uint32_t random = 99;
    long last = 100;
    save_iteration(path, last);
    const char *kills = getenv("UNBAKE_KILLS");
    int rounds = kills ? atoi(kills) : 15;
    for (int round = 0; round < rounds; round++) {
        int ends[2];
        CHECK(pipe(ends) == 0);
        pid_t child = fork();
        if (child == 0) {
            struct checkpoint *c;
            struct state_array array[ARRAYS];
            state_init(array);
            if (checkpoint_open(&c, path, "scene+settings", note, &err) != STATUS_OK)
                _exit(1);
            for (long k = last + 1;; k++) {
                state_set(array, k);
                if (checkpoint_save(c, k, array, ARRAYS, NULL, &err) != STATUS_OK)
                    _exit(1);
                if (write(ends[1], &k, sizeof k) != (ssize_t)sizeof k)
                    _exit(1);
            }
        }
        close(ends[1]);
        long acknowledged = last, got;
        random = random * 1664525u + 1013904223u;
        usleep(1000 + (random >> 8) % 40000);
        kill(child, SIGKILL);
        int status;
        CHECK(waitpid(child, &status, 0) == child && WIFSIGNALED(status));
        while (read(ends[0], &got, sizeof got) == (ssize_t)sizeof got)
            acknowledged = got;
        close(ends[0]);
        long found = load_from(path, note);
        CHECK_THAT(found >= acknowledged && found <= acknowledged + 1 && !note[0],
                   "round %d: acknowledged %ld, found %ld (%s)", round, acknowledged, found, note);
        last = found;
    }
}

int main(void) {
    char *dir = fresh_dir(), *path = file_join(dir, "checkpoint.db");
    test_hash();
    struct state_array loaded[ARRAYS];
    test_round_trip(path, loaded);
    test_others(path, loaded);
    test_damage(path);
    test_digest(path);
    test_read_twice(path);
    test_full_disk(path);
    test_kill(path);
    test_format_before(path);
    OK(file_remove_tree(dir, &err));
    mem_free(path);
    mem_free(dir);
    return check_result();
}
