/* fuzz.h -- a fuzz target: a function that takes any bytes, and must survive them.
 *
 * Each test_NAME.c of this folder gives LLVMFuzzerTestOneInput and fuzz_seeds, and is linked twice:
 *
 *   make test   with driver.c: every seed, and the same few thousand mutants of them each time
 *   make fuzz   by clang with libFuzzer, which looks for inputs that reach new code (fuzz.sh)
 *
 * Seeds are the files of tests/fuzz/seeds/NAME, written by hand or found and mended since (found-*),
 * and what fuzz_seeds adds: files of the shared test data, bytes that it makes. What cannot be a
 * crash but must not be is said by MUST. */
#ifndef UNBAKE_TESTS_FUZZ_FUZZ_H
#define UNBAKE_TESTS_FUZZ_FUZZ_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/error.h"

/* Returns 0. */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

struct seeds;
void fuzz_seeds(struct seeds *s);

/* Larger files only slow the search down. */
#define SEED_MAX_BYTES ((size_t)32 << 10)

struct seed {
    uint8_t *data;
    size_t size;
};

struct seeds {
    struct seed *seed; /* [count] */
    size_t count;
    long mutants; /* how many driver.c makes; fuzz_seeds sets it: some seconds' worth under a sanitizer */
};

void seeds_add(struct seeds *s, const void *data, size_t size);
void seeds_text(struct seeds *s, const char *text);
/* The file or, recursively, the folder at `path`; only names that end in `suffix`. Absent: none. */
void seeds_path(struct seeds *s, const char *path, const char *suffix);
void seeds_data(struct seeds *s, const char *name, const char *suffix); /* of the shared test data */
void seeds_release(struct seeds *s);

/* A new folder in memory, removed when the program ends; static storage. */
const char *fuzz_folder(void);
/* Puts the bytes into the file `path`, in place of what was there. */
void fuzz_write(const char *path, const uint8_t *data, size_t size);
/* A copy that ends in a NUL, of the bytes up to their first NUL; to be freed. */
char *fuzz_text(const uint8_t *data, size_t size);

#define MUST(condition)                                                                                                \
    do {                                                                                                               \
        if (!(condition)) {                                                                                            \
            fprintf(stderr, "%s:%d: failed: %s\n", __FILE__, __LINE__, #condition);                                    \
            abort();                                                                                                   \
        }                                                                                                              \
    } while (0)

/* The same for a call that must return STATUS_OK; else it is told why it did not. */
#define MUST_OK(call, err)                                                                                             \
    do {                                                                                                               \
        if ((call) != STATUS_OK) {                                                                                     \
            fprintf(stderr, "%s:%d: failed: %s: %s\n", __FILE__, __LINE__, #call, (err)->message);                     \
            abort();                                                                                                   \
        }                                                                                                              \
    } while (0)

#endif
