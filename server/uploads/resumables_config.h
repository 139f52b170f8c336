/* resumables_config.h -- what resumable uploads need from the daemon. */
#ifndef UNBAKE_UPLOADS_RESUMABLES_CONFIG_H
#define UNBAKE_UPLOADS_RESUMABLES_CONFIG_H

#include <stdint.h>

struct folder; /* data/folder.h */
struct store;  /* store/store.h */

struct resumables_config {
    struct store *store; /* borrowed, and so is: */
    struct folder *folder;
    int64_t idle_ms;                 /* an upload that has not grown for this long loses its reserved space */
    void (*scene_added)(void *user); /* an upload has become a scene, which must be checked */
    void *user;
};

#endif
