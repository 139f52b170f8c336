/* readiness.h -- whether the database and the disk of the data folder answer, and in time. A thread of its own asks
 * them, so a disk that hangs holds up nobody who asks for it. */
#ifndef UNBAKE_HTTP_READINESS_H
#define UNBAKE_HTTP_READINESS_H

#include <stdint.h>

#include "common/error.h"
#include "server/store/store.h"

#define READINESS_WAIT_SEC 2 /* an answer that takes longer is none */

struct readiness; /* opaque; thread-safe */

/* Starts the thread; `store` and `data_dir` are borrowed. */
enum status readiness_new(struct readiness **r, struct store *store, const char *data_dir, struct error *err);
void readiness_free(struct readiness *r); /* NULL is fine */
/* A row and a file are written and read back, and *free_bytes is the room that there is. All who ask while that goes on
 * share it. STATUS_UNAVAILABLE when it takes longer than READINESS_WAIT_SEC, at once where it has for so long already. */
enum status readiness_ask(struct readiness *r, uint64_t *free_bytes, struct error *err);

#endif
