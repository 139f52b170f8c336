/* acceptor.h -- owns the listening socket and takes in the connections that arrive there, on a thread of its own, while
 * there is room. It never reads or writes one: whom it gives them to owns them from then on.
 *
 * libmicrohttpd would accept, too, but not stop: MHD_quiesce_daemon and each thread that waits by epoll remove the
 * socket from the thread's set, and the second to do so aborts the process (0.9.75, daemon.c). */
#ifndef UNBAKE_NET_ACCEPTOR_H
#define UNBAKE_NET_ACCEPTOR_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/socket.h>

#include "common/error.h"

struct acceptor; /* opaque; thread-safe */

/* Takes over the connection `fd`, which is non-blocking and close-on-exec. false: it was refused, and is already
 * closed. */
typedef bool acceptor_take(void *user, int fd, const struct sockaddr *address, socklen_t size);

/* Listens as bind_listen does. Connections wait in the kernel until acceptor_start, and whenever connection_max are
 * open. */
enum status acceptor_new(struct acceptor **a, const char *address, uint16_t *port, size_t connection_max,
                         acceptor_take *take, void *user, struct error *err);
enum status acceptor_start(struct acceptor *a, struct error *err); /* once */
/* A connection that was taken has ended. Any thread may call this and the next. */
void acceptor_ended(struct acceptor *a);
size_t acceptor_count(struct acceptor *a); /* taken and not ended */
/* Stops accepting; connections waiting in the kernel are refused. May be called again, but not by two threads at
 * once. */
void acceptor_stop(struct acceptor *a);
void acceptor_free(struct acceptor *a); /* also stops it; NULL is allowed */

#endif
