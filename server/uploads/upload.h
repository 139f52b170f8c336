/* upload.h -- a bundle that arrives in one request: written and hashed on the way.
 *
 * 1. It lies in DATA/uploads/ under a random name until it is complete and synced; only then is it renamed to
 *    DATA/scenes/ID/archive, or to the place of a job's file. Freeing it earlier removes it.
 * 2. Where the length is known, the space is reserved at the start.
 * 3. From upload_new until upload_publish or upload_free it is listed among the arrivals: limits count it from its
 *    admission. (Uploads in parts are rows of the store, which count from their creation.) */
#ifndef UNBAKE_UPLOADS_UPLOAD_H
#define UNBAKE_UPLOADS_UPLOAD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "common/sha256.h"

struct upload;   /* opaque */
struct arrivals; /* all that are arriving; opaque; thread-safe */

struct arrivals *arrivals_new(void);
void arrivals_free(struct arrivals *a); /* none is listed any more; NULL is allowed */

/* What of one user's is arriving. */
struct arrivals_sum {
    size_t count;
    uint64_t bytes;   /* the lengths; where one is not known, what has arrived */
    uint64_t pledged; /* of the lengths, still to come */
};
/* All but one (NULL: all). */
struct arrivals_sum arrivals_of(struct arrivals *a, int64_t user_id, const struct upload *but);

/* Creates the file of that user's upload; `length` in bytes, 0: unknown. STATUS_NO_SPACE if they cannot be reserved.
 * Borrows `arrivals`. */
enum status upload_new(struct upload **u, struct arrivals *arrivals, int64_t user_id, const char *data_dir,
                       uint64_t length, struct error *err);
/* *must_check_room: the space is not reserved and a step has been written; the caller checks the free space. */
enum status upload_write(struct upload *u, const void *data, size_t length, bool *must_check_room, struct error *err);
void upload_digest(struct upload *u, char hex[SHA256_HEX_SIZE]); /* of what has arrived */
enum status upload_sync(struct upload *u, struct error *err);
/* Moves the synced file durably to the archive's place of scene `id`. */
enum status upload_publish(struct upload *u, const char *data_dir, const char *id, struct error *err);
/* The same for the file `path`, which is complete and synced. */
enum status upload_place(const char *data_dir, const char *path, const char *id, struct error *err);
/* Moves the synced file durably to `path`, on the file system of the data folder; what was there is replaced. */
enum status upload_move(struct upload *u, const char *path, struct error *err);
/* Makes the archive's place durable after an upload_place that failed half-way. */
enum status upload_sync_place(const char *data_dir, const char *id, struct error *err);

uint64_t upload_bytes(const struct upload *u);
void upload_free(struct upload *u); /* NULL is allowed */

#endif
