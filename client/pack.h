/* pack.h -- what is uploaded, as a stream of bytes that can be read twice.
 *
 * A folder becomes a tar archive on the fly (GNU format: names are kept byte for byte). The same
 * files give the same bytes, hence the same SHA-256, on any machine: entries are sorted by name,
 * hold only what a scene needs (name, size, content) and carry a fixed mode, owner and time. A
 * file is sent as it is. Hidden files and __MACOSX are left out, symbolic links are followed. */
#ifndef UNBAKE_CLIENT_PACK_H
#define UNBAKE_CLIENT_PACK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "common/sha256.h"

struct pack; /* opaque */

/* Opens `path`, a folder or a file; lists it, reads no content. */
enum status pack_open(struct pack **pack, const char *path, struct error *err);
void pack_close(struct pack *pack);

size_t pack_file_count(const struct pack *pack);
/* Sum of the files' sizes: bytes to read; slightly less than the bytes to send. */
uint64_t pack_content_bytes(const struct pack *pack);

/* Moves the stream (back) to its first byte. */
enum status pack_rewind(struct pack *pack, struct error *err);
/* Reads up to `room` bytes; *got is 0 only at the end. STATUS_CONFLICT when a file has become shorter. */
enum status pack_read(struct pack *pack, void *bytes, size_t room, size_t *got, struct error *err);

/* Reads the whole stream for its length and SHA-256. `tick` (may be NULL) receives the bytes read; returning false
 * ends the reading with STATUS_CANCELLED. */
enum status pack_measure(struct pack *pack, bool (*tick)(void *user, uint64_t done), void *user, uint64_t *length,
                         char sha256[SHA256_HEX_SIZE], struct error *err);

#endif
