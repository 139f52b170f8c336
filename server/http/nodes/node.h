/* node.h -- who asks in the name of an attempt: the node that runs it (server/node), which shows the attempt's own
 * token and says which claimant it is. No user's token opens these routes, and an attempt's opens no others. */
#ifndef UNBAKE_HTTP_NODES_NODE_H
#define UNBAKE_HTTP_NODES_NODE_H

#include "server/http/api.h"
#include "server/store/remote.h"
#include "server/transport/message.h"

struct node_key {
    struct remote_key key; /* points into the rest */
    char token_sha256[SHA256_HEX_SIZE], claimant[REMOTE_CLAIMANT_SIZE];
};

/* Reads the key of the request: NULL, or the refusal, 401 without a token. Whether it is valid, the store knows. */
struct response *node_key(const struct request *r, struct node_key *key);
/* The reply to an error of store_remote_...: 401 where the token is not that of such an attempt. */
struct response *node_refusal(struct api *api, struct request *r, const struct error *err);
/* NULL where the request's attempt is this node's and goes on; refuses else. What enters reports asks the store
 * itself. */
struct response *node_check(struct api *api, struct request *r);

#endif
