/* problem.h -- error replies: application/problem+json (RFC 9457). */
#ifndef UNBAKE_HTTP_PROBLEM_H
#define UNBAKE_HTTP_PROBLEM_H

#include "common/error.h"
#include "common/json.h"
#include "server/http/message.h"

/* A reply of that HTTP status; its type and title follow from it. */
struct response *problem(const struct request *r, int status, const char *detail_format, ...)
    __attribute__((format(printf, 3, 4)));
/* The same with a hint ("" for none) and further members (an object, taken; NULL for none), which may have
 * their own type and title. */
struct response *problem_full(const struct request *r, int status, const char *detail, const char *hint,
                              cJSON *members);
/* 422 with invalid_params (an array of {name, reason, hint?}; taken). */
struct response *problem_invalid(const struct request *r, const char *detail, cJSON *params);
/* Appends one entry to such an array; hint may be NULL. */
void problem_param(cJSON *params, const char *name, const char *hint, const char *reason_format, ...)
    __attribute__((format(printf, 4, 5)));

/* What a failed call of the store or of the system becomes. Defects and broken devices are
 * logged here, with the request's id, and told the caller without details. */
struct response *problem_from(const struct request *r, const struct error *err);
/* The HTTP status of a reply to such an error. */
int problem_status(enum status status);

#endif
