/* application.h -- what answers requests, as the transport sees it: the functions that each request passes.
 *
 *   find ──> begin ──> (data ...) ──> finish            each but finish may end the request with a reply
 *                 always, at the end: drop, count
 *
 * They never run at the same time for one request; for different requests they do. */
#ifndef UNBAKE_TRANSPORT_APPLICATION_H
#define UNBAKE_TRANSPORT_APPLICATION_H

#include "server/transport/message.h"

struct application {
    void *user; /* handed to each function; borrowed */
    /* The host names, besides loopback's, that requests may be addressed to, separated by spaces or commas; NULL: any.
     * Borrowed. */
    const char *(*server_names)(void *user);
    /* Finds the route of a request whose head is well formed: sets r->route, r->pace and r->is_body_stored, or returns
     * the refusal. Never waits for a disk. */
    struct response *(*find)(void *user, struct request *r);
    /* The head is complete. NULL: the body may come. This and the next two may wait for a disk unless r->pace is
     * PACE_AT_ONCE; data may only where r->is_body_stored. */
    struct response *(*begin)(void *user, struct request *r);
    struct response *(*data)(void *user, struct request *r, const void *data, size_t length);
    struct response *(*finish)(void *user, struct request *r); /* never NULL */
    /* Drops what has arrived of the body, on disk too. May wait for a disk where r has such a body. */
    void (*drop)(struct request *r);
    /* The request is over. status: of the reply, 0 where none was sent. Never waits. */
    void (*count)(void *user, const struct request *r, int status);
    void (*tick)(void *user, double now_sec); /* about once a second while there are connections; clock_sec */
};

#endif
