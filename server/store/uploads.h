/* uploads.h -- resumable uploads: what has arrived of them, and what they became. As for all of the store, see
 * store.h. */
#ifndef UNBAKE_STORE_UPLOADS_H
#define UNBAKE_STORE_UPLOADS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "server/job/job.h"
#include "server/store/limits.h"
#include "server/store/retention.h"
#include "server/store/users.h"

struct store; /* store.h */

#define UPLOAD_ID_SIZE 33   /* 32 hex digits and the NUL */
#define UPLOAD_BOOT_SIZE 40 /* see boot.h */

struct upload_row {
    char id[UPLOAD_ID_SIZE];
    int64_t owner_id;
    char *owner;                  /* a user's name; "" for nobody */
    char *name;                   /* for the scene */
    char *metadata;               /* Upload-Metadata as sent by the client */
    char *reading;                /* for the scene, as in scene_row; "" or NULL: none */
    char sha256[SCENE_ID_SIZE];   /* of the whole, as announced by the client; "" if it was not */
    uint64_t length, received;    /* bytes; `received` are on disk */
    char boot[UPLOAD_BOOT_SIZE];  /* see store_upload_begin */
    char scene_id[SCENE_ID_SIZE]; /* the scene that it became; "" before */
    bool is_pinned;
    int64_t created_ms, updated_ms, expires_ms; /* expires_ms 0: never */
};
void upload_row_release(struct upload_row *row);

/* Adds an upload with nothing received. Uses id, owner_id, name, metadata, reading, sha256, length and boot of *row.
 * `hash`: the state of an empty hash. The limits count unfinished uploads. */
enum status store_upload_add(struct store *store, const struct upload_row *row, const void *hash, size_t hash_size,
                             const struct count_limits *limits, struct error *err);
/* *hash (may be NULL) becomes the stored state; STATUS_CORRUPT when its size differs. */
enum status store_upload_get(struct store *store, const char *id, struct upload_row *row, void *hash, size_t hash_size,
                             struct error *err);
/* Uploads of `who` (NULL or an admin: all), newest first; sha256 "": any; cursor as in store_scene_list. */
enum status store_upload_list(struct store *store, const struct caller *who, const char *sha256, const char *cursor,
                              size_t limit, struct upload_row *rows, size_t *count, char next_cursor[128],
                              struct error *err);
/* The file may now hold bytes beyond `received` that are valid until the machine restarts (`boot` is its boot id), or
 * ("") that are not to be used. */
enum status store_upload_begin(struct store *store, const char *id, const char *boot, struct error *err);
/* `received` bytes are on disk; `hash` is the state of their hash. A smaller number than before is no error and
 * changes nothing. */
enum status store_upload_advance(struct store *store, const char *id, uint64_t received, const void *hash,
                                 size_t hash_size, struct error *err);
enum status store_upload_finish(struct store *store, const char *id, const char *scene_id, struct error *err);
enum status store_upload_set_retention(struct store *store, const char *id, const struct retention *retention,
                                       struct error *err);
enum status store_upload_delete(struct store *store, const char *id, struct error *err);

#endif
