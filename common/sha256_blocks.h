/* sha256_blocks.h -- the compression function of SHA-256 (FIPS 180-4, 6.2.2) in several forms, for sha256.c and
 * its test. All give the same state. */
#ifndef UNBAKE_COMMON_SHA256_BLOCKS_H
#define UNBAKE_COMMON_SHA256_BLOCKS_H

#include <stddef.h>
#include <stdint.h>

extern const uint32_t sha256_round_constant[64];

/* Works `count` blocks of 64 bytes each into the state. */
typedef void sha256_blocks(uint32_t state[8], const uint8_t *data, size_t count);

sha256_blocks sha256_blocks_portable;
/* The form that uses this processor's own instructions, NULL where it has none. Cheap enough to ask each time. */
sha256_blocks *sha256_blocks_native(void);

#endif
