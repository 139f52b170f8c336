/* whole_body.h -- a body that is one file, on its way to disk: a bundle, or a file that a job's settings name. */
#ifndef UNBAKE_HTTP_WHOLE_BODY_H
#define UNBAKE_HTTP_WHOLE_BODY_H

#include "common/sha256.h"
#include "server/http/api.h"
#include "server/transport/message.h"

/* Refuses a body of that length with a reply, or NULL. */
typedef struct response *whole_body_check(struct api *api, const struct request *r, uint64_t length);

/* Start of the body of r: sets r->upload, or refuses with a reply, for which `check` is asked first. */
struct response *whole_body_begin(struct api *api, struct request *r, whole_body_check *check);
/* The next bytes; NULL, or a reply that ends the request. */
struct response *whole_body_data(struct api *api, struct request *r, const void *data, size_t length);
/* The body is complete: checks the caller's digests, syncs; hex is the content's SHA-256. */
struct response *whole_body_end(struct request *r, char hex[SHA256_HEX_SIZE]);

#endif
