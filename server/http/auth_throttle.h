/* auth_throttle.h -- how often an address may present wrong tokens.
 *
 * A token bucket for each address: AUTH_THROTTLE_BURST failures, refilled at AUTH_THROTTLE_PER_SEC. Further failures
 * get 429, are not logged, and cost the connection. Tokens are 192 random bits, which cannot be guessed at any rate:
 * the limit keeps such attempts from filling the log and loading the store. A valid token is always accepted, so
 * nobody behind the same address (a proxy that is not trusted, a lab's gateway) can lock the others out.
 *
 * An IPv6 address stands for its /64, which is one customer's. Memory is bounded: the address with most room left makes
 * place for a new one. Thread-safe. */
#ifndef UNBAKE_HTTP_AUTH_THROTTLE_H
#define UNBAKE_HTTP_AUTH_THROTTLE_H

#include "server/transport/message.h"

#define AUTH_THROTTLE_BURST 20.0  /* failures */
#define AUTH_THROTTLE_PER_SEC 0.5 /* a page left open with an old token retries every 3 s */

struct auth_throttle; /* opaque */

struct auth_throttle *auth_throttle_new(void);
void auth_throttle_free(struct auth_throttle *b);

/* A failure from `from` at `now_sec` (CLOCK_MONOTONIC). Returns 0 while the bucket has room, else seconds until it
 * has. *is_first: the bucket has just run empty. */
double auth_throttle_fail(struct auth_throttle *b, const struct address *from, double now_sec, bool *is_first);

#endif
