/* test_checkpoint_damage.c -- checkpoint.db: damage is found, a full disk or a kill leaves the one before. UNBAKE_KILLS
 * sets the number of kills (15). */
#include <fcntl.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>

#include "common/protocol.h"
#include "server/worker/checkpoint_file.h"
#include "tests/unit/checkpoint_rig.h"

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
    test_damage(path);
    test_digest(path);
    test_read_twice(path);
    test_full_disk(path);
    test_kill(path);
    OK(file_remove_tree(dir, &err));
    mem_free(path);
    mem_free(dir);
    return check_result();
}
