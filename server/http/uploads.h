/* uploads.h -- the body of PATCH /v1/uploads/ID on its way to the upload that it goes on with. */
#ifndef UNBAKE_HTTP_UPLOADS_H
#define UNBAKE_HTTP_UPLOADS_H

#include "server/http/api.h"
#include "server/http/message.h"

struct upload_patch; /* opaque */

/* Start of request r's body: sets r->patch, or refuses with a reply. */
struct response *uploads_begin(struct api *api, struct request *r);
/* The next bytes; NULL, or the reply that ends it. */
struct response *uploads_data(struct api *api, struct request *r, const void *data, size_t length);
void uploads_drop(struct upload_patch *p); /* NULL is fine; what has come stays with the upload */

#endif
