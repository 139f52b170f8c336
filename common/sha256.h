/* sha256.h -- SHA-256 (FIPS 180-4), incremental. */
#ifndef UNBAKE_COMMON_SHA256_H
#define UNBAKE_COMMON_SHA256_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"

#define SHA256_HEX_SIZE 65 /* 64 hex digits and the NUL */

struct sha256 {
    uint32_t state[8];
    uint64_t length; /* bytes so far */
    uint8_t block[64];
};

void sha256_init(struct sha256 *s);
void sha256_update(struct sha256 *s, const void *data, size_t length);
/* Writes the lower-case hex digest; s is spent afterwards. */
void sha256_hex(struct sha256 *s, char hex[SHA256_HEX_SIZE]);

/* Whether two texts of SHA256_HEX_SIZE are the same, in a time that does not depend on where they
 * differ. One that is shorter equals no digest. */
bool sha256_equal(const char *a, const char *b);
bool sha256_is_hex(const char *text); /* whether it is a digest: 64 lower-case hex digits */
void sha256_of(const void *data, size_t length, char hex[SHA256_HEX_SIZE]);
enum status sha256_of_file(const char *path, char hex[SHA256_HEX_SIZE], struct error *err);

#endif
