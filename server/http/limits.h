/* limits.h -- what one user may take of what all share: space that is pledged, uploads, checks, streams. Admins are bound by
 * none of it, and something is kept for them. (What a user keeps in the end is space.h's.) */
#ifndef UNBAKE_HTTP_LIMITS_H
#define UNBAKE_HTTP_LIMITS_H

#include "server/http/api.h"
#include "server/http/message.h"

/* Whether these limits bind who asks: not an admin, and nobody while the daemon is open. */
bool limits_bind(const struct request *r);

/* NULL; or the refusal of an upload of `bytes`, 0 where its length is not known. Under api->folder.scene_mutex where it must hold:
 * two at once would both find room. */
struct response *limits_check_upload(struct api *api, const struct request *r, uint64_t bytes);
/* The same for one more check of a scene. */
struct response *limits_check_checks(struct api *api, const struct request *r);
/* The same for an event stream. */
struct response *limits_check_stream(struct api *api, const struct request *r);

#endif
