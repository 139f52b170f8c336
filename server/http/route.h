/* route.h -- one row of the table of routes: which requests it takes, from whom, and what is done with
 * their bodies. */
#ifndef UNBAKE_HTTP_ROUTE_H
#define UNBAKE_HTTP_ROUTE_H

#include "server/http/message.h"

struct api;

enum route_body {
    ROUTE_BODY_IGNORED, /* a small one is read and forgotten */
    ROUTE_BODY_JSON,    /* collected in request.body */
    ROUTE_BODY_UPLOAD,  /* goes to disk */
    ROUTE_BODY_PATCH    /* goes on with an upload in parts; as JSON it is a change of it instead */
};

/* The role that a caller must have at least. */
enum route_access { ROUTE_PUBLIC, ROUTE_VIEWER, ROUTE_USER, ROUTE_ADMIN };

/* On what threads it is worked on; see listener.h. */
enum route_pace {
    ROUTE_AT_ONCE, /* needs neither the store nor a disk, nor who asks */
    ROUTE_QUICK,   /* asks or changes the store, opens a file */
    ROUTE_SLOW     /* syncs, hashes or looks through files as large as users make them */
};

struct route {
    enum method method;
    const char *pattern; /* "/v1/jobs/{job}": {x} is one part, {x...} one or more at the end */
    enum route_access access;
    struct response *(*handle)(struct api *api, struct request *r);
    enum route_body body;
    enum route_pace pace;
    const char *query; /* the names that it takes, separated by spaces */
};

#endif
