/* limits.h -- what one user may take of what all share: reserved space, uploads, checks, event streams. None of it
 * applies to admins, for whom a part is kept. (Limits on what a user keeps are in space.h.) */
#ifndef UNBAKE_HTTP_LIMITS_H
#define UNBAKE_HTTP_LIMITS_H

#include "server/events/hub.h"
#include "server/http/api.h"
#include "server/transport/message.h"

/* Whether these limits apply to the caller: not to admins, nor while the daemon is open. */
bool limits_bind(const struct request *r);

/* NULL, or the refusal of an upload of `bytes` (0: length unknown). A caller that goes on to reserve the space holds
 * api->folder.scene_mutex: two at once would both find room. */
struct response *limits_check_upload(struct api *api, const struct request *r, uint64_t bytes);
/* The same for a file that does not become a scene. */
struct response *limits_check_file(struct api *api, const struct request *r, uint64_t bytes);
/* limits_check_upload for one more check of a scene. Uploads under way count, too: each becomes a scene to check. */
struct response *limits_check_checks(struct api *api, const struct request *r);
/* How many event streams there may be, the caller's new one included. */
struct hub_limits limits_of_streams(const struct api *api, const struct request *r);
/* The refusal of one more; `answer` is not HUB_JOINED. */
struct response *limits_refuse_stream(const struct api *api, const struct request *r, enum hub_answer answer);

#endif
