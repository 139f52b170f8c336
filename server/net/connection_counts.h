/* connection_counts.h -- how many connections each address has, so that nobody takes all of them.
 *
 *      from                              may have
 *      loopback, or a trusted proxy      all: it is the machine's admin, or stands for many
 *      any other address                 of_one, and none of the last connections that are kept for loopback
 *
 * An IPv6 address stands for its /64, which is one customer's. Thread-safe. */
#ifndef UNBAKE_NET_CONNECTION_COUNTS_H
#define UNBAKE_NET_CONNECTION_COUNTS_H

#include "server/net/address.h"

struct connection_counts; /* opaque */

/* connection_max: of all; of_one: of one address, 0: no limit. `proxies` is borrowed, NULL: none. */
struct connection_counts *connection_counts_new(size_t connection_max, size_t of_one, const struct proxies *proxies);
void connection_counts_free(struct connection_counts *c);

enum connection_answer { CONNECTION_OK, CONNECTION_ADDRESS_FULL, CONNECTION_FULL };
/* Counts one more connection from that address; after CONNECTION_OK it counts until connection_counts_leave. */
enum connection_answer connection_counts_enter(struct connection_counts *c, const struct address *from);
void connection_counts_leave(struct connection_counts *c, const struct address *from);

#endif
