/* validation.h -- does a correction make held-out data agree better? A paired comparison of their robust costs. */
#ifndef UNBAKE_CAPTURE_VALIDATION_H
#define UNBAKE_CAPTURE_VALIDATION_H

#include <math.h>
#include <stdbool.h>
#include <stddef.h>

struct validation {
    double saved, squares; /* sums over the pairs of the cost saved, and of its square */
    double total;          /* sum of the costs before */
    size_t count;
};

/* Adds one cost before and after a correction. */
static inline void validation_add(struct validation *v, double before, double after) {
    v->saved += before - after;
    v->squares += (before - after) * (before - after);
    v->total += before;
    v->count++;
}

/* Whether the saving is more than so many standard errors above 0. */
static inline bool validation_is_significant(const struct validation *v, double standard_errors) {
    double error = sqrt(fmax(v->squares - v->saved * v->saved / fmax((double)v->count, 1.0), 0.0));
    return v->saved > standard_errors * error;
}

#endif
