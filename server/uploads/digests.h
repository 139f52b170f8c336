/* digests.h -- the SHA-256 of outputs, as the daemon finds it.
 *
 * A worker's own digest of a file is not trusted: it has parsed an untrusted upload. And a running worker
 * replaces an output by rename and announces it a little later, often with the same size. So each version of a file
 * (inode, size, times) is hashed once, by a thread of its own, from the time that it is announced, the smallest first;
 * the store keeps the digest, over restarts too.
 *
 * 1. No reply waits for the hash of a file, but for one of at most DIGESTS_AT_ONCE bytes, which it hashes itself.
 * 2. A version that has no digest yet has its tag: a rename, a write or a touch gives it another. */
#ifndef UNBAKE_UPLOADS_DIGESTS_H
#define UNBAKE_UPLOADS_DIGESTS_H

#include <stdatomic.h>
#include <stdint.h>

#include "common/error.h"
#include "common/sha256.h"
#include "server/store/store.h"

#define DIGESTS_AT_ONCE ((uint64_t)1 << 20) /* bytes; at most some 5 ms, from memory */

struct digests; /* opaque; thread-safe */

/* Starts the thread. `store` and `data_dir` are borrowed; the caller must have digests_wake called when a digest is
 * requested. */
enum status digests_new(struct digests **d, struct store *store, const char *data_dir, struct error *err);
void digests_free(struct digests *d); /* unfinished work continues after the next start; NULL is allowed */
void digests_wake(void *digests);
uint64_t digests_hashed_bytes(const struct digests *d); /* by the thread, since its start */
/* Waits until every requested digest is entered or found impossible. For tests. */
void digests_wait(struct digests *d);

/* Identity of an open file. */
struct digests_file {
    uint64_t bytes;
    char tag[33];              /* identifies its version: 32 hex digits */
    char hex[SHA256_HEX_SIZE]; /* "": not known yet; it has been requested */
};
/* Identifies an output's open file, without moving its offset. STATUS_UNAVAILABLE when it changed during the call. */
enum status digests_identify(struct digests *d, int64_t job_id, const struct output_row *row, int fd,
                             struct digests_file *file, struct error *err);

/* The same for a file that is not an output; `thing` and `name` identify it. Files above DIGESTS_AT_ONCE get no
 * digest. */
enum status digests_identify_file(int fd, const char *thing, const char *name, struct digests_file *file,
                                  struct error *err);

/* Hashes the open file. Once *stopping (may be NULL) is true it returns STATUS_CANCELLED. *version is the version
 * hashed; STATUS_UNAVAILABLE when it changed meanwhile. */
enum status digests_hash(int fd, const atomic_bool *stopping, struct file_version *version, char hex[SHA256_HEX_SIZE],
                         struct error *err);

#endif
