/* node_body.h -- the body of a PUT by a node, a file of its attempt, on its way to disk: under a name that nobody reads
 * until it is whole and has the digest that Repr-Digest gives. */
#ifndef UNBAKE_HTTP_NODES_NODE_BODY_H
#define UNBAKE_HTTP_NODES_NODE_BODY_H

#include "server/http/api.h"
#include "server/http/nodes/node.h"
#include "server/transport/message.h"

#define NODE_FILE_MAX ((uint64_t)1 << 40) /* bytes; the disk is what limits it */

/* Start of the body of r: sets r->upload, or refuses with a reply. The request's key has been checked. */
struct response *node_body_begin(struct api *api, struct request *r);
/* The next bytes; NULL, or a reply that ends the request. */
struct response *node_body_data(struct api *api, struct request *r, const void *data, size_t length);
/* The body is complete: gives the file its place `path` in the folder of the attempt, durably, unless the attempt is
 * over. `after`, which may be NULL, then runs while the attempt still cannot end. 204, or a refusal. */
struct response *node_body_end(struct api *api, struct request *r, const struct node_key *key, const char *path,
                               enum status (*after)(void *user, struct error *err), void *user);

#endif
