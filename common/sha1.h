/* sha1.h -- SHA-1 (FIPS 180-4), incremental: only because the tus protocol's checksum extension
 * demands it. It finds transmission errors; it proves nothing against an attacker. */
#ifndef UNBAKE_COMMON_SHA1_H
#define UNBAKE_COMMON_SHA1_H

#include <stddef.h>
#include <stdint.h>

#define SHA1_BYTES 20 /* of a digest */

struct sha1 {
    uint32_t state[5];
    uint64_t length; /* bytes so far */
    uint8_t block[64];
};

void sha1_init(struct sha1 *s);
void sha1_update(struct sha1 *s, const void *data, size_t length);
/* s is spent afterwards. */
void sha1_bytes(struct sha1 *s, uint8_t digest[SHA1_BYTES]);

#endif
