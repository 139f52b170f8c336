/* listener.h -- HTTP: sockets, threads and libmicrohttpd, of which nothing shows. What a request means, and what its
 * reply is, the application says (application.h).
 *
 *   head ──> head_check, find, begin ──> body: data ... ──> finish ──> reply
 *                    │ refused                  │ refused
 *                    └──> reply                 └──> reply written past the library, then drain
 *
 * 1. libmicrohttpd's own few threads never wait for a disk, nor for a mutex that somebody holds who does. They see to
 *    sockets, heads and what is in memory; the connection is suspended while a thread of a pool does the rest: `quick`
 *    what asks the store or opens a file, `slow` what syncs, or moves bodies from and to the disk (enum request_pace,
 *    exchange.h). So /healthz is answered whatever the disk does. tests/api/test_http_threads.c holds it.
 * 2. A stream with nothing to say is suspended, never asked again until it is woken.
 * 3. Stopping: accept nothing more, end the streams, let the pools finish, resume all, then stop the library, which
 *    aborts the process when it finds a suspended connection. */
#ifndef UNBAKE_TRANSPORT_LISTENER_H
#define UNBAKE_TRANSPORT_LISTENER_H

#include <stdint.h>

#include "server/net/address.h"
#include "server/net/guard.h"
#include "server/transport/application.h"

struct listener; /* opaque; thread-safe where said so */

struct listener_config {
    const char *address;                     /* numeric: "127.0.0.1", "::1" */
    uint16_t port;                           /* 0: any free one */
    const char *certificate_file, *key_file; /* HTTPS; certificate_file NULL: plain HTTP */
    unsigned connection_max;
    unsigned address_connection_max; /* of one address; 0: no limit. See connection_counts.h */
    const struct proxies *proxies;   /* trusted to name client addresses (address.h); NULL: none */
    struct guard_limits limits;
};

/* Listens and serves until listener_stop, which takes *l. Of `config` it borrows the proxies; `application` is copied,
 * its `user` borrowed. STATUS_INPUT: the address or the certificate cannot be used. */
enum status listener_start(struct listener **l, const struct listener_config *config,
                           const struct application *application, struct error *err);
uint16_t listener_port(const struct listener *l);
/* Reads the certificate and its key again, if there are any. Any thread, but not two at once. */
enum status listener_reload(struct listener *l, struct error *err);
/* Accepts no more connections; open ones are served. Any thread, but not two at once. */
void listener_quiesce(struct listener *l);
void listener_stop(struct listener *l); /* NULL is allowed */

size_t listener_connections(struct listener *l);
uint64_t listener_late(struct listener *l); /* connections shut for being too slow */
const char *listener_library_version(void);

#endif
