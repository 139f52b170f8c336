/* test_deliver_faults.c -- a webhook's message to a receiver that is not found, not reached, says nothing or nonsense:
 * it counts as not delivered, and the reason is told. */
#include "server/worker/deliver.h"

#include <arpa/inet.h>
#include <pthread.h>

#include "server/worker/tasks.h"
#include "tests/check.h"
#include "tests/system_faults.h"

static int connect_error, send_error; /* 0: they work */

int connect(int fd, const struct sockaddr *to, socklen_t size) {
    if (connect_error) {
        errno = connect_error;
        return -1;
    }
    return (int)syscall(SYS_connect, fd, to, size);
}

ssize_t send(int fd, const void *data, size_t length, int flags) {
    if (send_error) {
        errno = send_error;
        return -1;
    }
    return syscall(SYS_sendto, fd, data, length, flags, NULL, 0);
}

/* --- the receiver ------------------------------------------------------------------------------------ */

static const char *_Atomic reply; /* to the next who calls */

static void *receive(void *user) {
    char request[4096];
    for (;;) {
        int fd = accept4(*(int *)user, NULL, NULL, SOCK_CLOEXEC);
        if (fd < 0)
            return NULL;
        const char *text = reply;
        if (recv(fd, request, sizeof request, 0) > 0)
            CHECK(syscall(SYS_sendto, fd, text, strlen(text), MSG_NOSIGNAL, NULL, 0) >= 0);
        close(fd);
    }
}

/* --- the sender -------------------------------------------------------------------------------------- */

static int port;

static void check(const char *scheme, const char *host, enum status wanted, const char *sentence) {
    char url[128];
    struct error err = {0};
    snprintf(url, sizeof url, "%s://%s:%d/hook", scheme, host, port);
    struct order order = {.url = url, .secret = "secret", .body = "{}", .message_id = "msg_1", .allow_private = true};
    enum status status = task_deliver(&order, &(struct progress){.fd = -1}, &err);
    CHECK_THAT(status == wanted, "%s (%s): %s, %s", url, reply, status_name(status), err.message);
    CHECK_THAT(wanted == STATUS_OK || (err.status == status && strstr(err.message, sentence)), "%s: %s", url,
               err.message);
}

int main(void) {
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof at;
    pthread_t receiver;
    faults_are_off = true;
    int listener = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    CHECK(bind(listener, (struct sockaddr *)&at, size) == 0 && listen(listener, 8) == 0);
    CHECK(getsockname(listener, (struct sockaddr *)&at, &size) == 0);
    port = ntohs(at.sin_port);
    CHECK(pthread_create(&receiver, NULL, receive, &listener) == 0);

    reply = "HTTP/1.1 204 No Content\r\n\r\n";
    check("http", "127.0.0.1", STATUS_OK, "");
    reply = "HTTP/1.1 500 Oh\r\n\r\n";
    check("http", "127.0.0.1", STATUS_UNAVAILABLE, "answered 500");
    reply = "HTTP/1.1 302 There\r\n\r\n";
    check("http", "127.0.0.1", STATUS_UNAVAILABLE, "answered 302");
    reply = "";
    check("http", "127.0.0.1", STATUS_UNAVAILABLE, "there was no reply");
    reply = "nonsense";
    check("http", "127.0.0.1", STATUS_UNAVAILABLE, "there was no reply");
    check("https", "127.0.0.1", STATUS_UNAVAILABLE, "TLS with 127.0.0.1: ");
    check("ftp", "127.0.0.1", STATUS_INPUT, "");
    check("http", "a..b", STATUS_UNAVAILABLE, "a..b: ");
    send_error = EPIPE;
    check("http", "127.0.0.1", STATUS_UNAVAILABLE, "the connection broke");
    send_error = 0;
    connect_error = EINPROGRESS; /* as a timeout is told */
    check("http", "127.0.0.1", STATUS_UNAVAILABLE, "timed out");
    connect_error = ECONNREFUSED;
    check("http", "127.0.0.1", STATUS_UNAVAILABLE, "refused");
    connect_error = 0;
    faults_are_off = false;
    system_faults_arm_only("socket", 1, true);
    check("http", "127.0.0.1", STATUS_IO, "cannot make a socket");
    faults_are_off = true;
    CHECK(system_faults_lift());

    shutdown(listener, SHUT_RDWR);
    pthread_join(receiver, NULL);
    close(listener);
    return check_result();
}
