/* tus.h -- the tus protocol 1.0.0 (tus.io) as all requests of /v1/uploads have it: its version, the upload that the
 * path names, what replies say of it. */
#ifndef UNBAKE_HTTP_TUS_H
#define UNBAKE_HTTP_TUS_H

#include <stdbool.h>

#include "server/http/api.h"
#include "server/transport/message.h"

/* Checks Tus-Resumable, which is required where `is_needed`. NULL when the version is ours. */
struct response *tus_check_version(const struct request *r, bool is_needed);
/* The reply to a failed call that concerns an upload: 413 where it was longer than announced, else as problem_from. */
struct response *tus_refuse(const struct request *r, const struct error *err);

bool tus_is_upload_id(const char *id);
/* The id in the path, of an upload of the caller's; or *refusal. Others' uploads do not exist for the caller. */
const char *tus_find_upload(struct api *api, const struct request *r, struct response **refusal);

/* Adds Upload-Expires, unless the upload is pinned (0). */
void tus_add_expiry(struct response *reply, int64_t expires_ms);
/* Adds Upload-Offset, and the scene that the upload has become, or when it expires. */
void tus_add_place(struct response *reply, const struct upload_row *row);

#endif
