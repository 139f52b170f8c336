/* sandbox_others.h -- what a process in the sandbox must not reach: another process, sockets, folders; and whether it
 * did. */
#ifndef UNBAKE_TESTS_UNIT_SANDBOX_OTHERS_H
#define UNBAKE_TESTS_UNIT_SANDBOX_OTHERS_H

#include <errno.h>
#include <fcntl.h>
#include <linux/sched.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sched.h>
#include <signal.h>
#include <stddef.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <time.h>

#include "common/file.h"
#include "tests/check.h"

static char root[] = "/tmp/unbake-test-sandbox-XXXXXX";
static char *data, *writable, *readable, *photo;
static pid_t victim;  /* another process of this user */
static int ends[2];   /* a pipe that a confined process has, as workers have theirs */
static int listening; /* a TCP port of this machine, as the daemon's */
static uint16_t port;

static inline struct sockaddr_in loopback(uint16_t number) {
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_port = htons(number)};
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    return address;
}

static inline socklen_t socket_path(struct sockaddr_un *address, bool is_abstract) {
    *address = (struct sockaddr_un){.sun_family = AF_UNIX};
    int length = snprintf(address->sun_path + is_abstract, sizeof address->sun_path - 1, "%s/admin.sock", root);
    return (socklen_t)(offsetof(struct sockaddr_un, sun_path) + (size_t)length + is_abstract);
}

static inline void set_up(void) {
    struct error err;
    struct sockaddr_in any = loopback(0);
    struct sockaddr_un abstract;
    socklen_t length = sizeof any;
    CHECK(mkdtemp(root) != NULL);
    data = file_join(root, "data");
    writable = file_join(data, "write");
    readable = file_join(data, "read");
    photo = file_join(readable, "photo");
    CHECK(file_make_dirs(writable, &err) == STATUS_OK && file_make_dirs(readable, &err) == STATUS_OK);
    CHECK(file_replace(photo, "x", 1, &err) == STATUS_OK && chmod(data, 0700) == 0);
    CHECK(pipe2(ends, O_CLOEXEC) == 0);
    listening = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    CHECK(bind(listening, (struct sockaddr *)&any, sizeof any) == 0 && listen(listening, 8) == 0);
    CHECK(getsockname(listening, (struct sockaddr *)&any, &length) == 0);
    port = ntohs(any.sin_port);
    int local = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    length = socket_path(&abstract, true);
    CHECK(bind(local, (struct sockaddr *)&abstract, length) == 0 && listen(local, 8) == 0);
    victim = fork();
    if (victim == 0) {
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        for (;;)
            pause();
    }
}

static inline void look_at_others(void) {
    struct stat info;
    struct error err;
    CHECK(waitpid(victim, NULL, WNOHANG) == 0); /* it lives */
    CHECK(getpriority(PRIO_PROCESS, (id_t)victim) == getpriority(PRIO_PROCESS, 0));
    CHECK(sched_getscheduler(victim) == sched_getscheduler(0));
    CHECK(stat(data, &info) == 0 && (info.st_mode & 07777) == 0700);
    CHECK(stat(photo, &info) == 0 && info.st_size == 1);
    kill(victim, SIGKILL);
    waitpid(victim, NULL, 0);
    CHECK(file_remove_tree(root, &err) == STATUS_OK);
}

#endif
