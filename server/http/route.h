/* route.h -- a row of the route table: which requests it takes, from whom, and where their bodies go. */
#ifndef UNBAKE_HTTP_ROUTE_H
#define UNBAKE_HTTP_ROUTE_H

#include "server/transport/message.h"

struct api;

enum route_body {
    ROUTE_BODY_IGNORED,  /* read and dropped */
    ROUTE_BODY_JSON,     /* collected in request.body */
    ROUTE_BODY_UPLOAD,   /* a bundle, written to disk */
    ROUTE_BODY_FILE,     /* written to disk, for an attempt */
    ROUTE_BODY_JOB_FILE, /* a file that a job's settings name, written to disk */
    ROUTE_BODY_PATCH     /* written to a resumable upload; a JSON body changes the upload instead */
};

/* The lowest role that is allowed; ROUTE_NODE: none, but the token of the attempt that the path names. */
enum route_access { ROUTE_PUBLIC, ROUTE_NODE, ROUTE_VIEWER, ROUTE_USER, ROUTE_ADMIN };

struct route {
    enum method method;
    const char *pattern; /* "/v1/jobs/{job}": {x} is one segment, {x...} one or more at the end */
    enum route_access access;
    struct response *(*handle)(struct api *api, struct request *r);
    enum route_body body;
    enum request_pace pace; /* of the handler */
    const char *query; /* its parameters, separated by spaces; unknown ones get 400. NULL: takes any and ignores them */
};

#endif
