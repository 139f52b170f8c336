/* body.h -- a request's body that was collected whole, as JSON. */
#ifndef UNBAKE_HTTP_BODY_H
#define UNBAKE_HTTP_BODY_H

#include "common/json.h"
#include "server/http/message.h"

/* The object that the body is, the caller's; NULL, with *refusal set, where it is none. */
cJSON *body_object(const struct request *r, struct response **refusal);

#endif
