/* upload.h -- a bundle that arrives in one piece: written and hashed as it comes.
 *
 * 1. It lies in DATA/uploads/ under a random name until it is complete and synced; only then is it renamed to
 *    DATA/scenes/ID/archive. What is freed before that leaves nothing behind.
 * 2. Space is reserved at the start where the length is known. */
#ifndef UNBAKE_UPLOADS_UPLOAD_H
#define UNBAKE_UPLOADS_UPLOAD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "common/sha256.h"

struct upload; /* opaque */

/* Makes the file; `length`: bytes that will come, 0: not known. STATUS_NO_SPACE where they cannot be reserved. */
enum status upload_new(struct upload **u, const char *data_dir, uint64_t length, struct error *err);
/* The next bytes. *must_check_room: space could not be reserved and much has come since the last time; the caller looks
 * whether others have filled the disk meanwhile. */
enum status upload_write(struct upload *u, const void *data, size_t length, bool *must_check_room, struct error *err);
void upload_digest(struct upload *u, char hex[SHA256_HEX_SIZE]); /* of what has come */
enum status upload_sync(struct upload *u, struct error *err);
/* Moves the synced file to where the archive of scene `id` belongs, durably. */
enum status upload_publish(struct upload *u, const char *data_dir, const char *id, struct error *err);
/* The same for the file `path`, which is complete and synced. */
enum status upload_place(const char *data_dir, const char *path, const char *id, struct error *err);
/* That the archive of scene `id` has its place is on disk: after an upload_place that failed half-way. */
enum status upload_sync_place(const char *data_dir, const char *id, struct error *err);

uint64_t upload_bytes(const struct upload *u);
void upload_free(struct upload *u); /* NULL is fine */

#endif
