/* test_checkpoint.c -- checkpoint.db: what is saved comes back, the unchanged is not written again; other settings, and
 * the format before. */
#include <sqlite3.h>
#include <sys/stat.h>

#include "common/hash64.h"
#include "common/protocol.h"
#include "server/worker/checkpoint_file.h"
#include "tests/unit/checkpoint_rig.h"

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

int main(void) {
    char *dir = fresh_dir(), *path = file_join(dir, "checkpoint.db");
    test_hash();
    struct state_array loaded[ARRAYS];
    test_round_trip(path, loaded);
    test_others(path, loaded);
    test_format_before(path);
    OK(file_remove_tree(dir, &err));
    mem_free(path);
    mem_free(dir);
    return check_result();
}
