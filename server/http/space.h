/* space.h -- free space on the disk of the data folder, and each user's share of it. */
#ifndef UNBAKE_HTTP_SPACE_H
#define UNBAKE_HTTP_SPACE_H

#include <stdint.h>

#include "server/http/api.h"
#include "server/transport/message.h"

/* Refuses with a reply unless min_free_bytes + `bytes` are free. */
struct response *space_check_free(struct api *api, const struct request *r, uint64_t bytes);
/* The same for what a running job writes, on this machine or through its node: nothing is kept free for others. */
struct response *space_check_job(struct api *api, const struct request *r, uint64_t bytes);
/* Refuses when what the caller keeps, not counting the scene `but_scene` (NULL: none), plus what is arriving in other
 * requests of the caller's, plus `bytes` passes user_max_bytes. A caller that goes on to add the scene holds
 * api->folder.scene_mutex: two at once would both find room. */
struct response *space_check_share(struct api *api, const struct request *r, const char *but_scene, uint64_t bytes);

#endif
