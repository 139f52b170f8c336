/* hash.h -- the SHA-256 of files that may take a while: on the way somebody is called. */
#ifndef UNBAKE_NODE_HASH_H
#define UNBAKE_NODE_HASH_H

#include <stdbool.h>

#include "common/error.h"
#include "common/sha256.h"

/* Hashes the whole open file, wherever its offset stands. Every HASH_STEP bytes go_on(user, err) is called: false ends
 * it with STATUS_CANCELLED. */
enum status hash_file(int fd, bool (*go_on)(void *user, struct error *err), void *user, char hex[SHA256_HEX_SIZE],
                      struct error *err);

#endif
