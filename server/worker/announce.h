/* announce.h -- tells the daemon of a file that is whole under its final name, with the hash of what is there. */
#ifndef UNBAKE_WORKER_ANNOUNCE_H
#define UNBAKE_WORKER_ANNOUNCE_H

#include <stdint.h>

#include "common/error.h"
#include "server/worker/progress.h"

/* `type` is EVENT_OUTPUT or EVENT_PREVIEW, `path` the file, `name` its name below out/. *bytes (may be NULL): its
 * length. */
enum status announce_file(struct progress *progress, const char *type, const char *path, const char *name,
                          const char *content_type, uint64_t *bytes, struct error *err);
/* The same of a file whose hash is known. */
enum status announce_known(struct progress *progress, const char *type, const char *path, const char *name,
                           const char *content_type, const char *sha256, uint64_t *bytes, struct error *err);
/* By the name's ending. */
const char *announce_content_type(const char *name);

#endif
