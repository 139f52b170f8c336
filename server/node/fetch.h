/* fetch.h -- what an attempt needs before it begins, from the daemon: its scene, by way of the cache, and the
 * checkpoint that it goes on from. */
#ifndef UNBAKE_NODE_FETCH_H
#define UNBAKE_NODE_FETCH_H

#include "server/node/relay.h"
#include "server/node/scene_cache.h"

/* Makes the attempt's scene present. *scene needs cached_scene_release in any case. STATUS_CANCELLED: stopped, or the
 * link is not open any more. */
enum status fetch_scene(struct relay *r, const char *cache_dir, uint64_t cache_bytes, struct cached_scene *scene,
                        struct error *err);
/* Fetches the checkpoint, if there is one, to `folder`, which is there. */
enum status fetch_checkpoint(struct relay *r, const char *folder, struct error *err);

#endif
