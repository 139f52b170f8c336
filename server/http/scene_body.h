/* scene_body.h -- the body of POST /v1/scenes, a bundle, on its way to disk. */
#ifndef UNBAKE_HTTP_SCENE_BODY_H
#define UNBAKE_HTTP_SCENE_BODY_H

#include "common/sha256.h"
#include "server/http/api.h"
#include "server/transport/message.h"

/* Start of the body of r: sets r->upload, or refuses with a reply. */
struct response *scene_body_begin(struct api *api, struct request *r);
/* The next bytes; NULL, or a reply that ends the request. */
struct response *scene_body_data(struct api *api, struct request *r, const void *data, size_t length);
/* The body is complete: checks the caller's digests, syncs; id is the content's SHA-256. */
struct response *scene_body_end(struct request *r, char id[SHA256_HEX_SIZE]);

#endif
