/* body.h -- a request's body that was collected in memory, as JSON. */
#ifndef UNBAKE_TRANSPORT_BODY_H
#define UNBAKE_TRANSPORT_BODY_H

#include "common/json.h"
#include "server/transport/message.h"

/* The body as a JSON object, the caller's; NULL, with *refusal set, where it is not one. */
cJSON *body_object(const struct request *r, struct response **refusal);

#endif
