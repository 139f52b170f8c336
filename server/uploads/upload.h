/* upload.h -- a body on its way to disk: written and hashed as it arrives.
 *
 * 1. It lives in DATA/uploads/ under a name of no meaning until it is whole and synced; only then
 *    is it renamed to DATA/scenes/ID/archive. What is freed before that leaves nothing behind.
 * 2. Space is reserved at the start where the length is known; min_free_bytes stay free always. */
#ifndef UNBAKE_UPLOADS_UPLOAD_H
#define UNBAKE_UPLOADS_UPLOAD_H

#include <stdint.h>

#include "common/sha256.h"
#include "server/http/api.h"
#include "server/http/message.h"

struct upload; /* opaque */

/* Start of request r's body: sets r->upload, or refuses with a reply. */
struct response *upload_begin(struct api *api, struct request *r);
/* The next bytes; NULL, or the reply that ends it. */
struct response *upload_data(struct api *api, struct request *r, const void *data, size_t length);
/* All has come: checks the caller's digests, syncs, and says the content's SHA-256. */
struct response *upload_seal(struct api *api, struct request *r, char id[SHA256_HEX_SIZE]);
/* Moves the sealed file to its place, durably. */
enum status upload_publish(struct api *api, struct upload *u, const char *id, struct error *err);
/* Moves the file `path`, which is whole and synced, to where the archive of scene `id` belongs. */
enum status upload_place(struct api *api, const char *path, const char *id, struct error *err);
/* That the archive of scene `id` has its place is on disk: after an upload_place that failed half-way. */
enum status upload_sync_place(struct api *api, const char *id, struct error *err);

uint64_t upload_bytes(const struct upload *u);
void upload_free(struct upload *u); /* NULL is fine */

#endif
