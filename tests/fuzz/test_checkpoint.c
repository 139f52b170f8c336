/* test_checkpoint.c -- a damaged checkpoint.db is used only where all of it is as it was saved.
 *
 *   input: changes to a good file, four bytes each: three of the place, one new value; a last byte
 *          alone cuts the file short at so many 256ths */
#include "server/worker/checkpoint.h"

#include <sqlite3.h>
#include <unistd.h>

#include "common/file.h"
#include "common/mem.h"
#include "tests/fuzz/fuzz.h"

#define FINGERPRINT "scene and settings"

static uint8_t texture[40000], counter[8];

static struct buf good; /* the file */

static void fill(uint8_t *to, size_t size, unsigned factor) {
    for (size_t i = 0; i < size; i++)
        to[i] = (uint8_t)(i * factor >> 3);
}

static void save_good(const char *path) {
    struct checkpoint *c;
    char note[512];
    sqlite3_config(SQLITE_CONFIG_PAGECACHE, NULL, 0, 0); /* or a megabyte and more is mapped for each input */
    fill(texture, sizeof texture, 77);
    fill(counter, sizeof counter, 9);
    struct state_array arrays[2] = {{"texture", texture, sizeof texture, 1}, {"counter", counter, sizeof counter, 1}};
    MUST(checkpoint_open(&c, path, FINGERPRINT, note, NULL) == STATUS_OK);
    MUST(checkpoint_save(c, 12, arrays, 2, NULL, NULL) == STATUS_OK);
    checkpoint_close(c);
    buf_init(&good, 1 << 22);
    MUST(file_read(path, &good, NULL) == STATUS_OK);
}

/* Loads what is there; it is what was saved, or nothing. */
static void load(const char *path) {
    static uint8_t found_texture[sizeof texture], found_counter[sizeof counter];
    struct state_array arrays[2] = {{"texture", found_texture, sizeof texture, 1},
                                    {"counter", found_counter, sizeof counter, 1}};
    struct checkpoint *c;
    char note[512];
    struct error err = {.message = ""};
    bool found;
    long iteration;
    enum status status = checkpoint_open(&c, path, FINGERPRINT, note, &err);
    if (status != STATUS_OK)
        fprintf(stderr, "%s\n", err.message);
    MUST(status == STATUS_OK);
    status = checkpoint_load(c, arrays, 2, &found, &iteration, &err);
    if (status == STATUS_OK && found) {
        MUST(iteration == 12 && memcmp(found_texture, texture, sizeof texture) == 0);
        MUST(memcmp(found_counter, counter, sizeof counter) == 0);
    }
    checkpoint_close(c);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    char *path = file_join(fuzz_folder(), "checkpoint.db"),
         *journal = file_join(fuzz_folder(), "checkpoint.db-journal");
    if (good.length == 0)
        save_good(path);
    uint8_t *bytes = malloc(good.length);
    size_t length = good.length;
    memcpy(bytes, good.data, length);
    for (; size >= 4; data += 4, size -= 4)
        bytes[((size_t)data[0] << 16 | (size_t)data[1] << 8 | data[2]) % length] = data[3];
    if (size == 1)
        length = length * data[0] / 256;
    unlink(journal);
    fuzz_write(path, bytes, length);
    free(bytes);
    load(path);
    mem_free(journal);
    mem_free(path);
    return 0;
}

void fuzz_seeds(struct seeds *s) {
    s->mutants = 200;
    seeds_add(s, "", 0);
    seeds_add(s, "\x80", 1);
    seeds_add(s, "\0\0\144\5\0\1\0\7\1\0\0\2\2\0\20\1", 16); /* in the header, the schema, a page, a tile */
}
