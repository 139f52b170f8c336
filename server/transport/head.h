/* head.h -- what a request's head must be like before anything else looks at it.
 *
 * libmicrohttpd 0.9.75 lets requests pass that two servers may read differently (request
 * smuggling); and a daemon without tokens on loopback must not obey web pages that a user's
 * browser happens to show (DNS rebinding, cross-site requests). */
#ifndef UNBAKE_TRANSPORT_HEAD_H
#define UNBAKE_TRANSPORT_HEAD_H

#include "server/transport/message.h"

/* NULL when the head is acceptable, else the refusal, with must_close set where it is unclear where the next request
 * begins. `version` is as sent: "HTTP/1.1". `server_names` are the hosts besides loopback that this daemon answers
 * for, separated by spaces or commas; NULL: any, as where a token is required. */
struct response *head_check(const struct request *r, const char *version, const char *server_names);

/* Uses a caller's X-Request-Id where it is a plain word; otherwise makes one. */
void head_request_id(struct request *r);

#endif
