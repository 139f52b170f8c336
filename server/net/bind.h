/* bind.h -- the socket that the daemon listens on. */
#ifndef UNBAKE_NET_BIND_H
#define UNBAKE_NET_BIND_H

#include <stdint.h>

#include "common/error.h"

/* Listens at a numeric address. *port, 0 for any free one, becomes the one that it is. *fd, which does not
 * block, is the caller's. STATUS_INPUT: that is no address. */
enum status bind_listen(int *fd, const char *address, uint16_t *port, struct error *err);

#endif
