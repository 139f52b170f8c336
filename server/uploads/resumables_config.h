/* resumables_config.h -- what uploads in parts need of the daemon. */
#ifndef UNBAKE_UPLOADS_RESUMABLES_CONFIG_H
#define UNBAKE_UPLOADS_RESUMABLES_CONFIG_H

#include <stdint.h>

struct folder; /* data/folder.h */
struct store;  /* store/store.h */

struct resumables_config {
    struct store *store; /* borrowed, and so is: */
    struct folder *folder;
    int64_t idle_ms;                 /* after which an upload that does not grow gives its space back */
    void (*scene_added)(void *user); /* an upload has become a scene, which is to be checked */
    void *user;
};

#endif
