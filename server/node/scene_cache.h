/* scene_cache.h -- scenes on a node's disk, for all attempts that come to that machine, or to all machines that share
 * the folder.
 *
 *   CACHE/ID/        the scene's files; NAME.part: one that is being fetched
 *   CACHE/ID.use     locked (flock, shared) by whoever reads the scene, and alone by who removes it; its time is that
 *                    of the last use
 *   CACHE/ID.fetch   locked alone by who fetches files of it
 *
 * 1. A file has its name only when its digest was right. It is hashed again for every attempt: what is damaged is
 *    fetched again, and replaced by a rename, so that whoever reads it is not disturbed.
 * 2. In a folder in which everybody may make others (/var/tmp), CACHE is this user's or root's: whoever else made it
 *    could change scenes after they were hashed, and read them.
 * 3. A scene that is in use is not removed. Where it takes more than its bound, or the disk is full, the cache gives up
 *    those that have not been used for longest. */
#ifndef UNBAKE_NODE_SCENE_CACHE_H
#define UNBAKE_NODE_SCENE_CACHE_H

#include <stdbool.h>
#include <stdint.h>

#include "common/error.h"
#include "common/json.h"

/* Where files come from. */
struct scene_source {
    void *user;
    /* Appends what is missing of the file to the open one. */
    enum status (*fetch)(void *user, const char *name, int fd, struct error *err);
    /* Called now and then; false: give up, with *err set. */
    bool (*go_on)(void *user, struct error *err);
};

struct cached_scene {
    char *files; /* the folder with the files; owned */
    int use_fd;  /* while it is open, the scene stays; -1: none */
    uint64_t fetched_bytes;
};

/* Makes the scene's files present and right. `list`: [{"name","bytes","sha256"},...] of the daemon. Waits while another
 * fetches it. *scene needs cached_scene_release in any case. STATUS_NO_SPACE: the disk is full, and there is nothing to
 * give up. STATUS_CORRUPT: a file arrives wrong, twice. STATUS_INPUT: the folder is another user's. */
enum status scene_cache_take(struct cached_scene *scene, const char *cache_dir, uint64_t cache_bytes,
                             const char *scene_id, const cJSON *list, const struct scene_source *source,
                             struct error *err);
void cached_scene_release(struct cached_scene *scene);

/* Fetches one file to `path`, whose folder is there, going on with PATH.part; checks size and digest, and fetches it
 * anew once where they are wrong. */
enum status scene_cache_fetch_file(const char *path, const cJSON *file, const struct scene_source *source,
                                   struct error *err);

#endif
