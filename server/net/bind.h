/* bind.h -- the socket that the daemon listens on. */
#ifndef UNBAKE_NET_BIND_H
#define UNBAKE_NET_BIND_H

#include <stdint.h>

#include "common/error.h"

/* Listens at a numeric address. *port 0 picks a free port, which *port becomes. *fd is non-blocking and the caller's.
 * STATUS_INPUT: not an address. */
enum status bind_listen(int *fd, const char *address, uint16_t *port, struct error *err);

#endif
