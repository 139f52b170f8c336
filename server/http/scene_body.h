/* scene_body.h -- the body of POST /v1/scenes, a bundle, on its way to disk. */
#ifndef UNBAKE_HTTP_SCENE_BODY_H
#define UNBAKE_HTTP_SCENE_BODY_H

#include "common/sha256.h"
#include "server/http/api.h"
#include "server/http/message.h"

/* Start of request r's body: sets r->upload, or refuses with a reply. */
struct response *scene_body_begin(struct api *api, struct request *r);
/* The next bytes; NULL, or the reply that ends it. */
struct response *scene_body_data(struct api *api, struct request *r, const void *data, size_t length);
/* All has come: checks the caller's digests, syncs, and says the content's SHA-256. */
struct response *scene_body_end(struct request *r, char id[SHA256_HEX_SIZE]);

#endif
