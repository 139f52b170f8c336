/* retention.h -- how long things are kept, as HTTP sees it: `pinned` and `expires_at` in a PATCH, and
 * what removing something would free. */
#ifndef UNBAKE_HTTP_RETENTION_H
#define UNBAKE_HTTP_RETENTION_H

#include "server/http/api.h"
#include "server/http/message.h"

/* Takes a member of a PATCH's body where it is about keeping: true, with any fault in params. */
bool retention_read(struct retention *k, const cJSON *member, cJSON *params);

/* `dry_run` of a query, 0 or 1; NULL, or the refusal. */
struct response *retention_dry_run(const struct request *r, bool *dry_run);
/* The reply to a dry run of removing DATA/`path`, or (NULL) nothing. */
struct response *retention_would_free(struct api *api, const struct request *r, const char *path);

#endif
