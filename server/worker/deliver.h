/* deliver.h -- a webhook's call, made by a process of its own: the daemon never resolves a host name that a
 * user gave, speaks to that server or reads what it says.
 *
 * 1. Every address that the name has is looked at before it is called, and it is that address that
 *    is called: a name that changes in between gains nothing. Private addresses are refused
 *    unless the daemon's configuration lets them be.
 * 2. Redirects are not followed. What comes back is read up to its status, which must be 2xx.
 * 3. A message is signed as standardwebhooks.com has it: HMAC-SHA256 over "ID.TIMESTAMP.BODY". The key is what is
 *    base64 behind whsec_ in the secret. A secret of another form is the key as it stands: the library verifies such
 *    messages with whsec_ and the base64 of that text. */
#ifndef UNBAKE_WORKER_DELIVER_H
#define UNBAKE_WORKER_DELIVER_H

#include <stdbool.h>
#include <sys/socket.h>

/* False for loopback, private, link-local, multicast, reserved and other special addresses, also when embedded in
 * IPv6. */
bool deliver_is_public(const struct sockaddr *address);

/* "v1,BASE64" for a secret as its owner gave it. */
void deliver_sign(const char *secret, const char *id, long long timestamp, const char *body, char signature[64]);

/* The status, 100 to 999, in the status line of an HTTP/1.0 or 1.1 reply; 0 if there is none. The line may continue,
 * or be cut off after the status. */
int deliver_status(const char *line);

#endif
