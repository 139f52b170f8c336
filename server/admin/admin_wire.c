/* admin_wire.c -- see admin_wire.h. */
#include "server/admin/admin_wire.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/un.h>
#include <unistd.h>

#include "common/mem.h"
#include "server/data/layout.h"

/* Through the folder's descriptor: a socket's address has 108 bytes, and a path may be longer. */
int admin_wire_address(const char *dir, int fd, int (*call)(int, const struct sockaddr *, socklen_t)) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    int dir_fd = open(dir, O_PATH | O_DIRECTORY | O_CLOEXEC);
    if (dir_fd < 0)
        return -1;
    snprintf(address.sun_path, sizeof address.sun_path, "/proc/self/fd/%d/" LAYOUT_SOCKET, dir_fd);
    int result = call(fd, (struct sockaddr *)&address, sizeof address);
    int number = errno;
    close(dir_fd);
    errno = number;
    return result;
}

bool admin_wire_send(int to, const cJSON *value, int fd) {
    char *text = json_text(value), *line = mem_printf("%s\n", text);
    union {
        struct cmsghdr head;
        char bytes[CMSG_SPACE(sizeof(int))];
    } control = {0};
    struct iovec part = {.iov_base = line, .iov_len = strlen(line)};
    struct msghdr message = {.msg_iov = &part, .msg_iovlen = 1};
    mem_free(text);
    if (fd >= 0) {
        message.msg_control = control.bytes;
        message.msg_controllen = sizeof control.bytes;
        struct cmsghdr *head = CMSG_FIRSTHDR(&message);
        head->cmsg_level = SOL_SOCKET;
        head->cmsg_type = SCM_RIGHTS;
        head->cmsg_len = CMSG_LEN(sizeof fd);
        memcpy(CMSG_DATA(head), &fd, sizeof fd);
    }
    while (part.iov_len > 0) {
        ssize_t sent = sendmsg(to, &message, MSG_NOSIGNAL);
        if (sent < 0 && errno == EINTR)
            continue;
        if (sent <= 0)
            break;
        part.iov_base = (char *)part.iov_base + sent;
        part.iov_len -= (size_t)sent;
        message.msg_control = NULL;
        message.msg_controllen = 0;
    }
    mem_free(line);
    return part.iov_len == 0;
}

bool admin_wire_receive(int from, struct buf *line, int *fd) {
    *fd = -1;
    while (line->length == 0 || line->data[line->length - 1] != '\n') {
        char chunk[4096];
        union {
            struct cmsghdr head;
            char bytes[CMSG_SPACE(sizeof(int))];
        } control;
        struct iovec part = {.iov_base = chunk, .iov_len = sizeof chunk};
        struct msghdr message = {
            .msg_iov = &part, .msg_iovlen = 1, .msg_control = control.bytes, .msg_controllen = sizeof control.bytes};
        ssize_t got = recvmsg(from, &message, MSG_CMSG_CLOEXEC);
        if (got < 0 && errno == EINTR)
            continue;
        struct cmsghdr *head = got > 0 ? CMSG_FIRSTHDR(&message) : NULL;
        if (head && head->cmsg_level == SOL_SOCKET && head->cmsg_type == SCM_RIGHTS && *fd < 0)
            memcpy(fd, CMSG_DATA(head), sizeof *fd);
        if (got <= 0 || !buf_append(line, chunk, (size_t)got))
            return false;
    }
    return true;
}
