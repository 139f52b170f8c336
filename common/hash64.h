/* hash64.h -- XXH64 (Yann Collet, 2014; specification at xxhash.com), a fast 64-bit hash.
 *
 * Detects accidental changes (a flipped bit, a stale page), not attacks: every change within eight aligned bytes
 * changes the hash, others go undetected with probability 2^-64. */
#ifndef UNBAKE_COMMON_HASH64_H
#define UNBAKE_COMMON_HASH64_H

#include <stddef.h>
#include <stdint.h>

uint64_t hash64(const void *data, size_t bytes, uint64_t seed);

#endif
