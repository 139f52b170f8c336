/* routes.h -- the table of routes, and the way of a request through it, as application.h describes.
 *
 *   routes_find ──> routes_begin ──> (routes_data ...) ──> routes_finish
 *
 * Each but the last may end the request with a reply; routes_finish always does. They never run at the
 * same time for one request. All but routes_find may wait for a disk, and routes_drop_body too; not so those of a
 * route that is PACE_AT_ONCE, nor routes_data of a body that is not stored. */
#ifndef UNBAKE_HTTP_ROUTES_H
#define UNBAKE_HTTP_ROUTES_H

#include "server/http/api.h"
#include "server/http/route.h"
#include "server/transport/message.h"

const struct route *routes_table(size_t *count);

#define ROUTES_BODY_MAX ((size_t)1 << 20) /* bytes of a body that is not an upload */

struct response *routes_find(struct request *r);
struct response *routes_begin(struct api *api, struct request *r);
struct response *routes_data(struct api *api, struct request *r, const void *data, size_t length);
struct response *routes_finish(struct api *api, struct request *r);
/* Drops what has arrived of the body, on disk too: the request was refused or answered, or has broken off. */
void routes_drop_body(struct request *r);

#endif
