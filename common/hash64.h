/* hash64.h -- XXH64 (Yann Collet, 2014; specification at xxhash.com), a fast 64-bit hash.
 *
 * It finds accidents (a flipped bit, a page of another time), not attacks: every change of up to
 * eight bytes at one aligned place changes the hash, others slip through once in 2^64. */
#ifndef UNBAKE_COMMON_HASH64_H
#define UNBAKE_COMMON_HASH64_H

#include <stddef.h>
#include <stdint.h>

uint64_t hash64(const void *data, size_t bytes, uint64_t seed);

#endif
