/* problem.h -- error replies: application/problem+json (RFC 9457). */
#ifndef UNBAKE_TRANSPORT_PROBLEM_H
#define UNBAKE_TRANSPORT_PROBLEM_H

#include "common/error.h"
#include "common/json.h"
#include "server/transport/message.h"

/* A reply with that HTTP status, which decides its type and title. */
struct response *problem(const struct request *r, int status, const char *detail_format, ...)
    __attribute__((format(printf, 3, 4)));
/* The same with a hint ("" for none) and more members (an object, taken; NULL for none), which may override type and
 * title. */
struct response *problem_full(const struct request *r, int status, const char *detail, const char *hint,
                              cJSON *members);
/* 422 with invalid_params (an array of {name, reason, hint?}; taken). */
struct response *problem_invalid(const struct request *r, const char *detail, cJSON *params);
/* Appends one entry to such an array; hint may be NULL. */
void problem_param(cJSON *params, const char *name, const char *hint, const char *reason_format, ...)
    __attribute__((format(printf, 4, 5)));

/* The reply to a failed call of the store or the system. Bugs and device errors are logged here with the request's
 * id; the caller gets no details. */
struct response *problem_from(const struct request *r, const struct error *err);
/* The HTTP status for such an error. */
int problem_status(enum status status);

#endif
