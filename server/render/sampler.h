/* sampler.h -- counter-based random numbers: Owen-scrambled Sobol pairs.
 *
 * A pair is a pure function of (seed, index, iteration, sample, pair number). For a fixed key the
 * pairs of consecutive samples are a randomly scrambled, randomly shuffled (0,2)-sequence (the
 * first two Sobol dimensions), independent between pair numbers and between keys: padding as in
 * Burley, Practical Hash-based Owen Scrambling (2020). The scramble is the Laine-Karras hash
 * with the constants of Vegdahl (2021). Everything is lane-wise integer arithmetic without
 * tables or branches: loops over keys vectorise. */
#ifndef UNBAKE_RENDER_SAMPLER_H
#define UNBAKE_RENDER_SAMPLER_H

#include <stdint.h>

#include "common/rng.h"
#include "common/vec.h"

/* The key of one stream of samples: a hash of everything but sample and pair. */
static inline uint32_t sampler_key(uint64_t seed, uint32_t index, uint32_t iteration) {
    return (uint32_t)(rng_key(seed, index, iteration) >> 32);
}

static inline uint32_t sampler_reverse(uint32_t x) {
    x = (x >> 16) | (x << 16);
    x = ((x & UINT32_C(0xff00ff00)) >> 8) | ((x & UINT32_C(0x00ff00ff)) << 8);
    x = ((x & UINT32_C(0xf0f0f0f0)) >> 4) | ((x & UINT32_C(0x0f0f0f0f)) << 4);
    x = ((x & UINT32_C(0xcccccccc)) >> 2) | ((x & UINT32_C(0x33333333)) << 2);
    return ((x & UINT32_C(0xaaaaaaaa)) >> 1) | ((x & UINT32_C(0x55555555)) << 1);
}

/* A hash in which a bit depends only on those below it: Owen scrambling of the reversed number. */
static inline uint32_t sampler_scramble(uint32_t reversed, uint32_t seed) {
    uint32_t x = reversed;
    x ^= x * UINT32_C(0x3d20adea);
    x += seed;
    x *= (seed >> 16) | 1;
    x ^= x * UINT32_C(0x05526c56);
    x ^= x * UINT32_C(0x53a22864);
    return x;
}

/* The second Sobol dimension of `index`, bits reversed: its generator matrix is Pascal's
 * triangle modulo 2, that is the polynomial with coefficients `index` at x + 1. */
static inline uint32_t sampler_sobol_reversed(uint32_t index) {
    uint32_t x = index;
    x ^= x >> 16;
    x ^= (x >> 8) & UINT32_C(0x00ff00ff);
    x ^= (x >> 4) & UINT32_C(0x0f0f0f0f);
    x ^= (x >> 2) & UINT32_C(0x33333333);
    x ^= (x >> 1) & UINT32_C(0x55555555);
    return x;
}

/* Two numbers in [0, 1). */
static inline vec2 sampler_pair(uint32_t key, uint32_t sample, uint32_t pair) {
    uint32_t seed = rng_mix32(key ^ (pair * UINT32_C(0x9e3779b9)));
    uint32_t index = sampler_reverse(sampler_scramble(sampler_reverse(sample), seed));
    uint32_t x = sampler_scramble(index, seed * UINT32_C(0x85ebca6b) + 1);
    uint32_t y = sampler_scramble(sampler_sobol_reversed(index), seed * UINT32_C(0xc2b2ae35) + 2);
    return (vec2){rng_to_float(sampler_reverse(x)), rng_to_float(sampler_reverse(y))};
}

/* One number in [0, 1), not stratified. */
static inline float sampler_number(uint32_t key, uint32_t sample, uint32_t pair) {
    return rng_to_float(rng_mix32(rng_mix32(key ^ (pair * UINT32_C(0x9e3779b9))) + sample));
}

#endif
