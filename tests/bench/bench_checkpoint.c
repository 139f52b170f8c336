/* bench_checkpoint.c -- time and bytes of a checkpoint of a 4096 x 4096 job: base colour with
 * validity (4 floats a texel) and two Adam moments (6), 671 MB. */
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/clock.h"
#include "common/file.h"
#include "common/hash64.h"
#include "common/mem.h"
#include "server/worker/checkpoint.h"
#include "server/worker/checkpoint_file.h"

static void touch(const struct state_array *array, size_t count, size_t every, uint32_t value) {
    for (size_t i = 0; i < count; i++)
        for (size_t at = 0; at < array[i].bytes / 4; at += every)
            ((uint32_t *)array[i].data)[at] += value + (uint32_t)at;
}

/* What the disk itself takes for as many bytes: written in one stream, then synced. */
static double raw_write(const char *dir, const struct state_array *array, size_t count) {
    struct error err;
    char *path = file_join(dir, "raw");
    double start = clock_sec();
    int fd = open(path, O_WRONLY | O_CREAT | O_TRUNC, 0600);
    for (size_t i = 0; i < count; i++)
        if (file_write_all(fd, array[i].data, array[i].bytes, path, &err) != STATUS_OK)
            fprintf(stderr, "%s\n", err.message);
    fsync(fd);
    close(fd);
    double seconds = clock_sec() - start;
    unlink(path);
    mem_free(path);
    return seconds;
}

int main(int argc, char **argv) {
    size_t side = argc > 1 ? (size_t)atol(argv[1]) : 4096;
    char dir[] = "/tmp/unbake-bench-checkpoint-XXXXXX";
    if (!mkdtemp(dir))
        return 1;
    struct state_array array[] = {{"base_color", NULL, side * side * 16, 1},
                                  {"mean", NULL, side * side * 12, 1},
                                  {"square", NULL, side * side * 12, 1}};
    size_t total = 0;
    for (size_t i = 0; i < 3; i++) {
        array[i].data = mem_calloc_large(array[i].bytes, 1);
        total += array[i].bytes;
    }
    touch(array, 3, 1, 1);
    double start = clock_sec();
    uint64_t hash = hash64(array[0].data, array[0].bytes, 0);
    printf("hash64: %.2f GB/s (%llx)\n", (double)array[0].bytes / (clock_sec() - start) * 1e-9,
           (unsigned long long)hash);
    printf("one stream and fsync: %.2f s for %.0f MB\n", raw_write(dir, array, 3), (double)total * 1e-6);
    static const struct {
        const char *what;
        size_t every;
    } round[] = {{"first", 1},
                 {"all changed", 1},
                 {"all changed", 1},
                 {"nothing changed", 0},
                 {"a tenth of the tiles changed", 10 * CHECKPOINT_TILE_BYTES / 4}};
    char *path = file_join(dir, "checkpoint.db"), note[512];
    struct checkpoint *c;
    struct error err;
    if (checkpoint_open(&c, path, "f", note, &err) != STATUS_OK)
        return fprintf(stderr, "%s\n", err.message), 1;
    for (size_t i = 0; i < sizeof round / sizeof round[0]; i++) {
        struct checkpoint_cost cost;
        struct stat info;
        if (round[i].every)
            touch(array, 3, round[i].every, (uint32_t)i);
        if (checkpoint_save(c, (long)i, array, 3, &cost, &err) != STATUS_OK)
            return fprintf(stderr, "%s\n", err.message), 1;
        stat(path, &info);
        printf("save, %s: %.2f s, %zu of %zu tiles, %.0f MB; the file has %.0f MB\n", round[i].what, cost.seconds,
               cost.written_tile_count, cost.tile_count, (double)cost.written_bytes * 1e-6,
               (double)info.st_size * 1e-6);
    }
    checkpoint_close(c);
    start = clock_sec();
    bool found;
    long iteration;
    if (checkpoint_open(&c, path, "f", note, &err) != STATUS_OK)
        return fprintf(stderr, "%s\n", err.message), 1;
    double opened = clock_sec();
    if (checkpoint_load(c, array, 3, &found, &iteration, &err) != STATUS_OK)
        return fprintf(stderr, "%s\n", err.message), 1;
    printf("open and verify: %.2f s, load: %.2f s\n", opened - start, clock_sec() - opened);
    checkpoint_close(c);
    file_remove_tree(dir, &err);
    mem_free(path);
    return 0;
}
