/* node.c -- see node.h. */
#include "server/http/nodes/node.h"

#include <limits.h>
#include <stdio.h>
#include <string.h>

#include "common/protocol.h"
#include "server/http/auth.h"
#include "server/http/route.h"
#include "server/net/field.h"
#include "server/transport/problem.h"

struct response *node_key(const struct request *r, struct node_key *key) {
    char token[TOKEN_SIZE];
    int64_t number;
    const char *claimant = request_field(r, NODE_CLAIMANT_FIELD);
    *key = (struct node_key){0};
    if (!field_number(r->target.segments[2], 1, INT64_MAX, &key->key.job_id) ||
        !field_number(r->target.segments[3], 1, INT_MAX, &number))
        return problem(r, 404, "no attempt has such a number");
    if (!auth_bearer(r, token)) {
        struct response *reply = problem(r, 401, "an attempt's token is missing");
        response_field(reply, "WWW-Authenticate", "Bearer realm=\"unbaked\"");
        return reply;
    }
    if (!claimant || strlen(claimant) < 16 || strlen(claimant) >= sizeof key->claimant ||
        strspn(claimant, "0123456789abcdef") != strlen(claimant))
        return problem(r, 400, NODE_CLAIMANT_FIELD " must have 16 to %zu hex digits", sizeof key->claimant - 1);
    sha256_of(token, strlen(token), key->token_sha256);
    snprintf(key->claimant, sizeof key->claimant, "%s", claimant);
    key->key.number = (int)number;
    key->key.token_sha256 = key->token_sha256;
    key->key.claimant = key->claimant;
    return NULL;
}

struct response *node_refusal(struct api *api, struct request *r, const struct error *err) {
    if (err->status == STATUS_NOT_FOUND)
        return auth_reject(api, r, NULL);
    if (err->status == STATUS_CONFLICT || err->status == STATUS_INPUT)
        return problem_full(r, 409, err->message, err->hint, NULL);
    if (err->status != STATUS_LIMIT)
        return problem_from(r, err);
    struct response *reply = problem_full(r, 503, err->message, err->hint, NULL);
    response_field(reply, "Retry-After", "1");
    return reply;
}

struct response *node_check(struct api *api, struct request *r) {
    struct node_key key;
    struct error err;
    struct response *refusal = node_key(r, &key);
    if (refusal || r->method == METHOD_POST)
        return refusal;
    return store_remote_may_read(api->store, &key.key, &err) == STATUS_OK ? NULL : node_refusal(api, r, &err);
}
