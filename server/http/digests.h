/* digests.h -- the SHA-256 of files that are served, remembered.
 *
 * A running worker replaces an output by rename and announces it a little later, often with the
 * same size. So neither the store's row nor the size says what a file holds: only its content
 * does. It is hashed once per version (device, inode, size, times), and every reply carries the
 * digest of the very bytes that follow. */
#ifndef UNBAKE_HTTP_DIGESTS_H
#define UNBAKE_HTTP_DIGESTS_H

#include <stdint.h>

#include "common/error.h"
#include "common/sha256.h"

struct digests; /* opaque; thread-safe */

struct digests *digests_new(void);
void digests_free(struct digests *d);

/* Size and digest of the regular file fd, whose offset is not moved. STATUS_UNAVAILABLE when it
 * changed while it was read. */
enum status digests_of(struct digests *d, int fd, uint64_t *size, char hex[SHA256_HEX_SIZE],
                       struct error *err);

#endif
