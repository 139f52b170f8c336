/* readiness.h -- whether the database and the disk of the data folder respond in time. A thread of its own probes
 * them, so a disk that hangs blocks nobody who asks. */
#ifndef UNBAKE_HTTP_READINESS_H
#define UNBAKE_HTTP_READINESS_H

#include <stdint.h>

#include "common/error.h"
#include "server/store/store.h"

#define READINESS_WAIT_SEC 2 /* a probe that takes longer has failed */

struct readiness; /* opaque; thread-safe */

/* Starts the thread; `store` and `data_dir` are borrowed. */
enum status readiness_new(struct readiness **r, struct store *store, const char *data_dir, struct error *err);
void readiness_free(struct readiness *r); /* NULL is allowed */
/* Writes and reads back a row and a file; *free_bytes is the free space. Callers that ask meanwhile share the probe.
 * STATUS_UNAVAILABLE when it takes longer than READINESS_WAIT_SEC; at once if it has already. */
enum status readiness_probe(struct readiness *r, uint64_t *free_bytes, struct error *err);

#endif
