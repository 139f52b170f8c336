/* cache_room.h -- room in the cache of scenes (scene_cache.h): what goes when it is full. */
#ifndef UNBAKE_NODE_CACHE_ROOM_H
#define UNBAKE_NODE_CACHE_ROOM_H

#include <stdbool.h>
#include <stdint.h>

#define CACHE_USE ".use"
#define CACHE_FETCH ".fetch"

/* Removes scenes that nobody uses, those that were not used for longest first, until `bytes` more fit into cache_bytes
 * (0: no bound). Where all others are in use, there is less room than wanted. */
void cache_room_make(const char *cache_dir, uint64_t cache_bytes, uint64_t bytes);
/* Removes the one that was not used for longest; false: there is none that nobody uses. */
bool cache_room_give_up(const char *cache_dir);

#endif
