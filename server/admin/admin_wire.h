/* admin_wire.h -- DATA/admin.sock as both sides use it: a line of JSON each way, and an open file beside it
 * (SCM_RIGHTS). */
#ifndef UNBAKE_ADMIN_ADMIN_WIRE_H
#define UNBAKE_ADMIN_ADMIN_WIRE_H

#include <stdbool.h>
#include <sys/socket.h>

#include "common/buf.h"
#include "common/json.h"

/* Calls bind or connect of fd with the socket's address in the data folder `dir`; its result, and errno. */
int admin_wire_address(const char *dir, int fd, int (*call)(int, const struct sockaddr *, socklen_t));
/* Writes a line, with a descriptor attached to its first byte (fd -1: none). false: the other side did not take it. */
bool admin_wire_send(int to, const cJSON *value, int fd);
#define ADMIN_WIRE_LINE_MAX ((size_t)1 << 20) /* bytes; for buf_init */
/* Appends a line and hands over any descriptor that comes with it (-1: none). false when there is no complete line. */
bool admin_wire_receive(int from, struct buf *line, int *fd);

#endif
