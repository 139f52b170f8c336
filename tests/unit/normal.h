/* normal.h -- a nearly normal random number, of mean 0 and variance 1, for each pair of keys. */
#ifndef UNBAKE_TESTS_NORMAL_H
#define UNBAKE_TESTS_NORMAL_H

#include "common/rng.h"

static inline float normal(uint64_t a, uint64_t b) {
    float sum = -6.0f; /* of twelve even numbers */
    for (uint64_t k = 0; k < 12; k++)
        sum += rng_to_float((uint32_t)rng_key(a, b, k));
    return sum;
}

#endif
