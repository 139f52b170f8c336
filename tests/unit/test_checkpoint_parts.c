/* test_checkpoint_parts.c -- checkpoints that travel as parts: those that another machine keeps are a whole checkpoint
 * at any time, only what has changed is sent, what is damaged is found. */
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/buf.h"
#include "common/file.h"
#include "common/mem.h"
#include "common/rng.h"
#include "server/data/layout.h"
#include "server/worker/checkpoint.h"
#include "server/worker/checkpoint_file.h"
#include "server/worker/checkpoint_parts.h"
#include "tests/check.h"

static struct error err;

#define OK(call) CHECK_THAT((call) == STATUS_OK, "%s", err.message)
#define CHECK_INT(found, wanted)                                                                                       \
    CHECK_THAT((long)(found) == (long)(wanted), "%ld, wanted %ld", (long)(found), (long)(wanted))
#define TILE CHECKPOINT_TILE_BYTES
#define BYTES (4 * TILE + 12)

struct place {
    char *dir, *db;
};

static struct place place_new(void) {
    char pattern[] = "/tmp/unbake-test-parts-XXXXXX";
    if (!mkdtemp(pattern))
        exit(1);
    return (struct place){mem_strdup(pattern), file_join(pattern, "checkpoint.db")};
}

static void place_free(struct place *p) {
    OK(file_remove_tree(p->dir, &err));
    mem_free(p->dir);
    mem_free(p->db);
}

static struct checkpoint *open_at(const struct place *p, const char *fingerprint, char note[512]) {
    struct checkpoint *c = NULL;
    OK(checkpoint_open(&c, p->db, fingerprint, note, &err));
    return c;
}

/* What whoever carries parts does: moves this one, and drops those that are no longer needed. */
static void carry(const struct place *from, const struct place *to, const struct written_part *part) {
    char *source = layout_part(from->dir, part->number), *target = layout_part(to->dir, part->number);
    CHECK(rename(source, target) == 0);
    for (int number = 1; number < part->first; number++) {
        char *old = layout_part(to->dir, number);
        unlink(old);
        mem_free(old);
    }
    mem_free(source);
    mem_free(target);
}

static uint64_t bytes_of_parts(const struct place *p) {
    uint64_t files, bytes = 0;
    OK(file_tree_size(p->dir, &files, &bytes, &err));
    return bytes;
}

/* The state that a copy of the place's parts gives: its iteration, or -1 with the note. */
static long state_at(const struct place *p, const void *wanted, char note[512]) {
    struct place copy = place_new();
    char *command = mem_printf("cp %s/* %s/", p->dir, copy.dir), *state = mem_calloc(BYTES, 1);
    struct state_array array = {"texture", state, BYTES, 1};
    bool found = false;
    long iteration = -1;
    CHECK(system(command) == 0);
    struct checkpoint *c = open_at(&copy, "f", note);
    OK(checkpoint_load(c, &array, 1, &found, &iteration, &err));
    CHECK(!found || !wanted || memcmp(state, wanted, BYTES) == 0);
    checkpoint_close(c);
    char **names = NULL;
    size_t count = 0;
    OK(file_list(copy.dir, &names, &count, &err));
    for (size_t i = 0; i < count; i++)
        CHECK(layout_part_number(names[i]) == 0); /* they are in the database now */
    file_free_names(names, count);
    place_free(&copy);
    mem_free(command);
    mem_free(state);
    return found ? iteration : -1;
}

/* Random tiles change; what has arrived is at any time the newest state, in bounded room. */
static void test_travel(void) {
    struct place here = place_new(), there = place_new();
    char note[512], *state = mem_calloc(BYTES, 1);
    struct state_array array = {"texture", state, BYTES, 1};
    struct checkpoint *c = open_at(&here, "f", note);
    uint64_t carried = 0;
    checkpoint_send_parts(c);
    for (long iteration = 1; iteration <= 90; iteration++) {
        struct written_part part;
        uint64_t random = rng_key(7, (uint64_t)iteration, 0);
        size_t tile = rng_below((uint32_t)random, 5);
        if (iteration < 12 || iteration > 80)
            state[tile * TILE + rng_below((uint32_t)(random >> 32), tile < 4 ? TILE : 12)]++;
        OK(checkpoint_save(c, iteration, &array, 1, NULL, &err));
        OK(checkpoint_write_part(c, &array, 1, false, &part, &err));
        CHECK(part.number == iteration);
        CHECK(part.number - part.first < PARTS_KEPT_MAX);
        carried += part.bytes;
        carry(&here, &there, &part);
        CHECK(bytes_of_parts(&there) <= (PARTS_STRETCH + 2) * BYTES + 64 * 2000);
        if (iteration % 9 == 1 || iteration == 12 || iteration > 85)
            CHECK_INT(state_at(&there, state, note), iteration);
    }
    checkpoint_close(c);
    CHECK_THAT(carried < 12 * (uint64_t)BYTES, "%llu bytes were carried", (unsigned long long)carried);
    mem_free(state);
    place_free(&here);
    place_free(&there);
}

/* Until a part is taken away no other is written, unless it must be; then two are there. */
static void test_pressure(void) {
    struct place here = place_new(), there = place_new();
    char note[512], *state = mem_calloc(BYTES, 1);
    struct state_array array = {"texture", state, BYTES, 1};
    struct written_part first, none, last;
    struct checkpoint *c = open_at(&here, "f", note);
    OK(checkpoint_save(c, 1, &array, 1, NULL, &err));
    OK(checkpoint_write_part(c, &array, 1, true, &none, &err));
    CHECK(none.number == 0); /* nobody has asked for parts */
    checkpoint_send_parts(c);
    OK(checkpoint_write_part(c, &array, 1, false, &first, &err));
    state[3] = 1;
    OK(checkpoint_save(c, 2, &array, 1, NULL, &err));
    OK(checkpoint_write_part(c, &array, 1, false, &none, &err));
    CHECK(first.number == 1 && none.number == 0);
    state[TILE] = 1;
    OK(checkpoint_save(c, 3, &array, 1, NULL, &err));
    OK(checkpoint_write_part(c, &array, 1, true, &last, &err));
    CHECK(last.number == 2 && last.first == 1 && last.bytes > 2 * TILE && last.bytes < 3 * TILE);
    carry(&here, &there, &first);
    carry(&here, &there, &last);
    CHECK_INT(state_at(&there, state, note), 3);
    checkpoint_close(c);

    /* The next machine goes on with the next number, and sends all of it first. */
    c = open_at(&there, "f", note);
    CHECK(!note[0]);
    checkpoint_send_parts(c);
    OK(checkpoint_save(c, 4, &array, 1, NULL, &err));
    OK(checkpoint_write_part(c, &array, 1, false, &last, &err));
    CHECK(last.number == 3 && last.first == 3 && last.bytes > BYTES);
    checkpoint_close(c);
    mem_free(state);
    place_free(&here);
    place_free(&there);
}

static void flip(const char *path, off_t at) {
    int fd = open(path, O_RDWR);
    unsigned char byte;
    CHECK(pread(fd, &byte, 1, at) == 1);
    byte ^= 4;
    CHECK(pwrite(fd, &byte, 1, at) == 1);
    close(fd);
}

/* Damage is said, never loaded; what was there before stays. */
static void test_damage(void) {
    struct place here = place_new(), there = place_new();
    char note[512], *state = mem_calloc(BYTES, 1), *path[2];
    struct state_array array = {"texture", state, BYTES, 1};
    struct written_part part;
    struct checkpoint *c = open_at(&here, "f", note);
    checkpoint_send_parts(c);
    for (int i = 0; i < 2; i++) {
        state[i * (int)TILE] = 9;
        OK(checkpoint_save(c, 5 + i, &array, 1, NULL, &err));
        OK(checkpoint_write_part(c, &array, 1, false, &part, &err));
        carry(&here, &there, &part);
        path[i] = layout_part(there.dir, part.number);
    }
    checkpoint_close(c);
    CHECK_INT(state_at(&there, state, note), 6);
    struct stat info;
    for (int i = 0; i < 2; i++) {
        CHECK(stat(path[i], &info) == 0);
        for (int k = 0; k < 40; k++) {
            off_t at = k < 30 ? k * 23 % 700 : (off_t)(k - 29) * info.st_size / 11; /* the head, then the data */
            flip(path[i], at);
            /* What the newer part has itself is not read from the older one. */
            long found = state_at(&there, state, note);
            CHECK_THAT(found == 6 || (found == -1 && strstr(note, "cannot be used")), "part %d, byte %lld: %ld, %s", i,
                       (long long)at, found, note);
            flip(path[i], at);
        }
        CHECK(truncate(path[i], info.st_size - 1) == 0);
        CHECK_INT(state_at(&there, state, note), -1);
        CHECK(truncate(path[i], info.st_size) == 0);
    }
    CHECK_INT(state_at(&there, state, note), 6);
    CHECK(unlink(path[0]) == 0);
    CHECK_INT(state_at(&there, state, note), -1);
    CHECK(strstr(note, "is missing") != NULL);

    /* A database that is there is kept where the parts are no good, and replaced where they are. */
    c = open_at(&there, "f", note);
    CHECK(strstr(note, "is missing") != NULL);
    OK(checkpoint_save(c, 3, &array, 1, NULL, &err));
    checkpoint_close(c);
    CHECK_INT(state_at(&there, state, note), 3);
    OK(file_replace(path[1], "{}\n", 3, &err));
    CHECK_INT(state_at(&there, state, note), 3);
    CHECK(strstr(note, "cannot be used") != NULL);
    for (int i = 0; i < 2; i++)
        mem_free(path[i]);
    mem_free(state);
    place_free(&here);
    place_free(&there);
}

int main(void) {
    test_travel();
    test_pressure();
    test_damage();
    return check_result();
}
