/* crowd.h -- how many connections each address has, so that nobody takes all of them.
 *
 *      from                              may have
 *      loopback, or a trusted proxy      all: it is the machine's admin, or stands for many
 *      any other address                 of_one, and none of the last connections that are kept for loopback
 *
 * An IPv6 address stands for its /64, which is one customer's. Thread-safe. */
#ifndef UNBAKE_HTTP_CROWD_H
#define UNBAKE_HTTP_CROWD_H

#include "server/http/address.h"

struct crowd; /* opaque */

/* connection_max: of all; of_one: of one address, 0: no limit. `proxies` is borrowed, NULL: none. */
struct crowd *crowd_new(size_t connection_max, size_t of_one, const struct proxies *proxies);
void crowd_free(struct crowd *c);

enum crowd_answer { CROWD_OK, CROWD_ADDRESS_FULL, CROWD_FULL };
/* One more from there; CROWD_OK: it is counted until crowd_leave. */
enum crowd_answer crowd_enter(struct crowd *c, const struct address *from);
void crowd_leave(struct crowd *c, const struct address *from);

#endif
