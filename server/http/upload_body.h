/* upload_body.h -- the body of PATCH /v1/uploads/ID: bytes of an upload on their way to disk, with the checksum that
 * the client may give of them (extension checksum of the tus protocol). */
#ifndef UNBAKE_HTTP_UPLOAD_BODY_H
#define UNBAKE_HTTP_UPLOAD_BODY_H

#include "server/http/api.h"
#include "server/transport/message.h"

/* Start of the body of r: sets r->patch, or refuses with a reply. */
struct response *upload_body_begin(struct api *api, struct request *r);
/* The next bytes; NULL, or a reply that ends the request. */
struct response *upload_body_data(struct api *api, struct request *r, const void *data, size_t length);
/* The body is complete: NULL, and *row is the upload as it is now (upload_row_release); or the refusal. */
struct response *upload_body_end(const struct request *r, struct upload_row *row);
/* Ends the upload's use, and frees; what has arrived is kept unless a checksum was given. NULL is allowed. */
void upload_body_drop(struct upload_patch *patch);

#endif
