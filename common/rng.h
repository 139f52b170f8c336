/* rng.h -- counter-based random numbers: pure functions of their arguments.
 *
 * Nothing here has state, so a number does not depend on which thread asks for it or when. */
#ifndef UNBAKE_COMMON_RNG_H
#define UNBAKE_COMMON_RNG_H

#include <stdint.h>

/* A bijective mix of 64 bits (the finaliser of splitmix64, Steele et al. 2014). */
static inline uint64_t rng_mix64(uint64_t x) {
    x += UINT64_C(0x9e3779b97f4a7c15);
    x = (x ^ (x >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
    x = (x ^ (x >> 27)) * UINT64_C(0x94d049bb133111eb);
    return x ^ (x >> 31);
}

/* A bijective mix of 32 bits (lowbias32, Wellons 2018). */
static inline uint32_t rng_mix32(uint32_t x) {
    x ^= x >> 16;
    x *= UINT32_C(0x7feb352d);
    x ^= x >> 15;
    x *= UINT32_C(0x846ca68b);
    return x ^ (x >> 16);
}

/* 64 random bits for a key of three words. */
static inline uint64_t rng_key(uint64_t a, uint64_t b, uint64_t c) {
    return rng_mix64(rng_mix64(rng_mix64(a) ^ b) ^ c);
}

/* The upper 24 bits of x as a float in [0, 1). */
static inline float rng_to_float(uint32_t x) { return (float)(x >> 8) * 0x1p-24f; }

/* Maps 32 random bits to [0, count) by a multiplication (bias below count / 2^32). */
static inline uint32_t rng_below(uint32_t bits, uint32_t count) { return (uint32_t)(((uint64_t)bits * count) >> 32); }

#endif
