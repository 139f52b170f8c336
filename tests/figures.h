/* figures.h -- for tests with a short and a long form: which of the two, and what was measured. */
#ifndef UNBAKE_TESTS_FIGURES_H
#define UNBAKE_TESTS_FIGURES_H

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>

/* How often or how many: `few` in `make test`, `many` in the long form; the variable `name`,
 * where it is set, wins over both. */
static inline long figures_count(const char *name, long few, long many) {
    const char *text = getenv(name);
    return text ? strtol(text, NULL, 10) : getenv("UNBAKE_LONG") ? many : few;
}

/* A row for tests/long.sh; `better` is "lower" or "higher". */
static inline void figure(const char *name, double value, double goal, const char *better) {
    printf("%s\t%.6g\t%.6g\t%s\n", name, value, goal, better);
    fflush(stdout);
}

#endif
