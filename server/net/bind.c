/* bind.c -- see bind.h. */
#include "server/net/bind.h"

#include <errno.h>
#include <netdb.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <unistd.h>

#define BACKLOG 512 /* connections that wait in the kernel to be accepted */

enum status bind_listen(int *fd, const char *address, uint16_t *port, struct error *err) {
    struct addrinfo hints = {
        .ai_family = AF_UNSPEC, .ai_socktype = SOCK_STREAM, .ai_flags = AI_NUMERICHOST | AI_NUMERICSERV | AI_PASSIVE};
    struct addrinfo *found;
    char text[8];
    snprintf(text, sizeof text, "%u", *port);
    int failed = getaddrinfo(address, text, &hints, &found);
    if (failed)
        return error_set(err, STATUS_INPUT, "cannot listen on %s: %s", address, gai_strerror(failed));
    enum status status = STATUS_OK;
    int one = 1;
    struct sockaddr_storage bound;
    socklen_t size = sizeof bound;
    *fd = socket(found->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (*fd < 0 || setsockopt(*fd, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one) != 0 ||
        bind(*fd, found->ai_addr, found->ai_addrlen) != 0 || listen(*fd, BACKLOG) != 0 ||
        getsockname(*fd, (struct sockaddr *)&bound, &size) != 0) {
        error_set_errno(err, errno, "cannot listen on %s port %s", address, text);
        status = error_hint(err, "--listen chooses another address");
        if (*fd >= 0)
            close(*fd);
        *fd = -1;
    } else if (getnameinfo((struct sockaddr *)&bound, size, NULL, 0, text, sizeof text, NI_NUMERICSERV) == 0)
        *port = (uint16_t)strtoul(text, NULL, 10);
    freeaddrinfo(found);
    return status;
}
