/* routes.h -- the table of routes, and the way of a request through it.
 *
 *   routes_begin ──> (routes_data ... routes_rest ...) ──> routes_finish
 *
 * Each of the first three may end the request with a reply; routes_finish always does. They never
 * run at the same time for one request. */
#ifndef UNBAKE_HTTP_ROUTES_H
#define UNBAKE_HTTP_ROUTES_H

#include "server/http/api.h"
#include "server/http/message.h"

enum route_body {
    ROUTE_BODY_IGNORED, /* a small one is read and forgotten */
    ROUTE_BODY_JSON,    /* collected in request.body */
    ROUTE_BODY_UPLOAD,  /* goes to disk */
    ROUTE_BODY_PATCH    /* goes on with an upload in parts; as JSON it is a change of it instead */
};

/* The role that a caller must have at least. */
enum route_access { ROUTE_PUBLIC, ROUTE_VIEWER, ROUTE_USER, ROUTE_ADMIN };

struct route {
    enum method method;
    const char *pattern; /* "/v1/jobs/{job}": {x} is one part, {x...} one or more at the end */
    enum route_access access;
    struct response *(*handle)(struct api *api, struct request *r);
    enum route_body body;
    bool is_slow;        /* may wait for a disk: not on a thread that serves others */
    const char *query;   /* the names that it takes, separated by spaces */
};

const struct route *routes_table(size_t *count);

#define ROUTES_BODY_MAX ((size_t)1 << 20) /* bytes of a body that is not an upload */

struct response *routes_begin(struct api *api, struct request *r);
struct response *routes_data(struct api *api, struct request *r, const void *data, size_t length);
/* Wanted by request.wants_rest, which it clears; waits for a disk. */
struct response *routes_rest(struct api *api, struct request *r);
struct response *routes_finish(struct api *api, struct request *r);

#endif
