/* check.h -- a test is a small program: it exits 0 when all checks held, 1 when one did not and
 * 77 when it cannot run here (with the reason as its last line). */
#ifndef UNBAKE_TESTS_CHECK_H
#define UNBAKE_TESTS_CHECK_H

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static int check_failed_count;

#define CHECK(condition)                                                                                               \
    do {                                                                                                               \
        if (!(condition)) {                                                                                            \
            fprintf(stderr, "%s:%d: failed: %s\n", __FILE__, __LINE__, #condition);                                    \
            check_failed_count++;                                                                                      \
        }                                                                                                              \
    } while (0)

/* As CHECK, with a formatted explanation of what was found. */
#define CHECK_THAT(condition, ...)                                                                                     \
    do {                                                                                                               \
        if (!(condition)) {                                                                                            \
            fprintf(stderr, "%s:%d: failed: %s: ", __FILE__, __LINE__, #condition);                                    \
            fprintf(stderr, __VA_ARGS__);                                                                              \
            fprintf(stderr, "\n");                                                                                     \
            check_failed_count++;                                                                                      \
        }                                                                                                              \
    } while (0)

#define CHECK_NEAR(found, wanted, tolerance)                                                                           \
    do {                                                                                                               \
        double check_a = (double)(found), check_b = (double)(wanted);                                                  \
        if (!(fabs(check_a - check_b) <= (double)(tolerance))) {                                                       \
            fprintf(stderr, "%s:%d: failed: %s is %.9g, wanted %.9g within %.3g\n", __FILE__, __LINE__, #found,        \
                    check_a, check_b, (double)(tolerance));                                                            \
            check_failed_count++;                                                                                      \
        }                                                                                                              \
    } while (0)

#define CHECK_STRING(found, wanted)                                                                                    \
    do {                                                                                                               \
        const char *check_a = (found), *check_b = (wanted);                                                            \
        if (!check_a || strcmp(check_a, check_b) != 0) {                                                               \
            fprintf(stderr, "%s:%d: failed: %s is \"%s\", wanted \"%s\"\n", __FILE__, __LINE__, #found,                \
                    check_a ? check_a : "(null)", check_b);                                                            \
            check_failed_count++;                                                                                      \
        }                                                                                                              \
    } while (0)

/* Where a test keeps what is synced to the disk all the time: in memory, where there is a place for that. */
static inline const char *check_fast_dir(void) { return access("/dev/shm", W_OK) == 0 ? "/dev/shm" : "/tmp"; }

/* Ends the test without judging it. */
#define CHECK_SKIP(...)                                                                                                \
    do {                                                                                                               \
        printf(__VA_ARGS__);                                                                                           \
        printf("\n");                                                                                                  \
        exit(77);                                                                                                      \
    } while (0)

static inline int check_result(void) { return check_failed_count == 0 ? 0 : 1; }

/* A file of the shared test data, or a skip where it is absent. The string is static per call
 * site's use: copy it to keep it. */
static inline const char *check_data(const char *name) {
    static char path[1024];
    const char *root = getenv("UNBAKE_TEST_DATA");
    snprintf(path, sizeof path, "%s/%s", root ? root : "../shared/data", name);
    if (access(path, R_OK) != 0)
        CHECK_SKIP("test data %s is not here", name);
    return path;
}

#endif
