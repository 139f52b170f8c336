/* cache_eviction.h -- which scenes leave the cache (scene_cache.h) when it is full. */
#ifndef UNBAKE_NODE_CACHE_EVICTION_H
#define UNBAKE_NODE_CACHE_EVICTION_H

#include <stdbool.h>
#include <stdint.h>

#define CACHE_USE ".use"
#define CACHE_FETCH ".fetch"

/* Removes scenes that nobody uses, those that were not used for longest first, until `bytes` more fit into cache_bytes
 * (0: no bound). Where all others are in use, less space is free than wanted. */
void cache_eviction_make_space(const char *cache_dir, uint64_t cache_bytes, uint64_t bytes);
/* Removes the one that was not used for longest; false: there is none that nobody uses. */
bool cache_eviction_evict_one(const char *cache_dir);

#endif
