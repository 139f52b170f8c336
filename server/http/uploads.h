/* uploads.h -- the body of PATCH /v1/uploads/ID, written to its upload. */
#ifndef UNBAKE_HTTP_UPLOADS_H
#define UNBAKE_HTTP_UPLOADS_H

#include "server/http/api.h"
#include "server/transport/message.h"

struct upload_patch; /* opaque */

/* Start of the body of r: sets r->patch, or refuses with a reply. */
struct response *uploads_begin(struct api *api, struct request *r);
/* The next bytes; NULL, or a reply that ends the request. */
struct response *uploads_data(struct api *api, struct request *r, const void *data, size_t length);
void uploads_drop(struct upload_patch *p); /* NULL is allowed; what has arrived stays in the upload */

#endif
