/* retention.h -- `pinned` and `expires_at` in a PATCH, and what a removal would free. */
#ifndef UNBAKE_HTTP_RETENTION_H
#define UNBAKE_HTTP_RETENTION_H

#include "server/http/api.h"
#include "server/transport/message.h"

/* Reads a member of a PATCH's body; false if it is not about retention. Faults go to params. */
bool retention_read(struct retention *k, const cJSON *member, cJSON *params);

/* Reads `dry_run` of a query, 0 or 1; NULL, or the refusal. */
struct response *retention_dry_run(const struct request *r, bool *dry_run);
/* The reply to a dry run of removing DATA/`path` (NULL: nothing). */
struct response *retention_would_free(struct api *api, const struct request *r, const char *path);

#endif
