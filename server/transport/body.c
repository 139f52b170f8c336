/* body.c -- see body.h. */
#include "server/transport/body.h"

#include "server/transport/problem.h"

cJSON *body_object(const struct request *r, struct response **refusal) {
    struct error err;
    cJSON *body = NULL;
    if (json_parse(buf_text(&r->body), r->body.length, "the request body", &body, &err) != STATUS_OK)
        *refusal = problem(r, 400, "%s", err.message);
    else if (!cJSON_IsObject(body))
        *refusal = problem(r, 400, "the request body is not a JSON object");
    else
        return body;
    cJSON_Delete(body);
    return NULL;
}
