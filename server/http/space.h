/* space.h -- room on the disk of the data folder: who may have more of it, and how it is given back. */
#ifndef UNBAKE_HTTP_SPACE_H
#define UNBAKE_HTTP_SPACE_H

#include <stdbool.h>
#include <stdint.h>

#include "server/http/api.h"
#include "server/http/message.h"

/* Refuses with the reply when the disk holds less than min_free_bytes + `bytes`. */
struct response *space_check_room(struct api *api, const struct request *r, uint64_t bytes);
/* The same when the caller keeps so much, but for the scene `but_scene` (NULL: all), that `bytes` more pass
 * user_max_bytes. Under api->folder.scene_mutex where it must hold: two at once would both find room. */
struct response *space_check_share(struct api *api, const struct request *r, const char *but_scene, uint64_t bytes);

#endif
