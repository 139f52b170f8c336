/* Deadlines: who is shut down when, with the time as a parameter. */
#include "common/clock.h"
#include "server/net/guard.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include "tests/check.h"

/* True once the other end of the pair sees that its partner was shut down. */
static int is_shut(int fd) {
    char byte;
    return recv(fd, &byte, 1, MSG_DONTWAIT) == 0;
}

/* A connection over TCP whose other end has room for little. */
static void connect_pair(int ends[2]) {
    struct sockaddr_in to = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof to;
    int listener = socket(AF_INET, SOCK_STREAM, 0), little = 4096;
    CHECK(bind(listener, (struct sockaddr *)&to, size) == 0 && listen(listener, 1) == 0);
    CHECK(getsockname(listener, (struct sockaddr *)&to, &size) == 0);
    ends[1] = socket(AF_INET, SOCK_STREAM, 0);
    setsockopt(ends[1], SOL_SOCKET, SO_RCVBUF, &little, sizeof little);
    CHECK(connect(ends[1], (struct sockaddr *)&to, size) == 0);
    ends[0] = accept(listener, NULL, NULL);
    close(listener);
}

/* A reply that is not taken, or too slowly, ends; one that is taken, or has nothing to send, not. */
static void check_readers(void) {
    struct guard_limits limits = {.head_sec = 1e6, .idle_sec = 1e6, .window_sec = 3000, .body_bytes_per_sec = 10};
    struct guard *g;
    struct error err;
    int ends[2];
    char chunk[65536] = "";
    CHECK(guard_new(&g, &limits, NULL, NULL, &err) == STATUS_OK);
    connect_pair(ends);
    struct guarded *c = guard_add(g, ends[0]);
    guard_enter(g, c, GUARD_REPLY);
    double now = clock_sec();
    guard_check_all(g, now + 1000);
    guard_check_all(g, now + 9000);
    CHECK(guard_shut_count(g) == 0); /* nothing waits: the daemon itself is slow */
    while (send(ends[0], chunk, sizeof chunk, MSG_DONTWAIT) > 0)
        ;
    guard_check_all(g, now + 10000); /* a window begins */
    size_t taken = 0;
    while (taken < 400000) { /* enough for 3,000 s at 10 bytes/s, and for the kernel to notice */
        ssize_t got = recv(ends[1], chunk, sizeof chunk, 0);
        taken += got > 0 ? (size_t)got : 400000;
        if (send(ends[0], chunk, sizeof chunk, MSG_DONTWAIT) < 0)
            continue;
    }
    guard_check_all(g, now + 12000);
    CHECK(guard_shut_count(g) == 0);
    guard_check_all(g, now + 13001);
    CHECK(guard_shut_count(g) == 0);
    guard_check_all(g, now + 16000);
    CHECK(guard_shut_count(g) == 0);
    guard_check_all(g, now + 16002); /* nothing was taken over a whole window */
    CHECK(guard_shut_count(g) == 1);
    guard_remove(g, c);
    close(ends[0]);
    close(ends[1]);
    guard_free(g);
}

int main(void) {
    check_readers();
    /* Real time never counts here: the limits are longer than the test by far. */
    struct guard_limits limits = {.head_sec = 1000, .idle_sec = 5000, .window_sec = 3000, .body_bytes_per_sec = 10};
    struct guard *g;
    struct error err;
    struct guarded *c[5];
    int ends[5][2];
    CHECK(guard_new(&g, &limits, NULL, NULL, &err) == STATUS_OK);
    for (int i = 0; i < 5; i++) {
        CHECK(socketpair(AF_UNIX, SOCK_STREAM, 0, ends[i]) == 0);
        c[i] = guard_add(g, ends[i][0]);
    }
    CHECK(guard_count(g) == 5);
    double now = clock_sec();
    guard_enter(g, c[1], GUARD_BODY);
    guard_enter(g, c[2], GUARD_REPLY);
    guard_enter(g, c[3], GUARD_IDLE);
    guard_enter(g, c[4], GUARD_SHORT_BODY);

    guard_check_all(g, now + 990);
    CHECK(guard_shut_count(g) == 0);
    guard_check_all(g, now + 1010); /* the head took too long */
    CHECK(is_shut(ends[0][1]) && guard_shut_count(g) == 1);
    guard_check_all(g, now + 1020); /* and is counted once */
    CHECK(guard_shut_count(g) == 1);

    guard_body(g, c[1], 31000); /* more than 10 bytes/s over the first window */
    guard_body(g, c[4], 100000);
    guard_check_all(g, now + 3010);
    CHECK(!is_shut(ends[1][1]));
    guard_body(g, c[1], 29000); /* less over the second */
    guard_body(g, c[4], 100000);
    guard_check_all(g, now + 4990);
    CHECK(!is_shut(ends[4][1])); /* fast enough, and not yet too long */
    guard_body(g, c[4], 100000);
    guard_check_all(g, now + 5010);
    CHECK(is_shut(ends[4][1]) && guard_shut_count(g) == 2);
    guard_check_all(g, now + 6000);
    CHECK(!is_shut(ends[1][1]));
    CHECK(!is_shut(ends[3][1])); /* idle may last its time and a head's */
    guard_check_all(g, now + 6020);
    CHECK(is_shut(ends[1][1]) && is_shut(ends[3][1]));
    guard_check_all(g, now + 1e9);
    CHECK(!is_shut(ends[2][1]) && guard_shut_count(g) == 4); /* no TCP: a reply has no deadline */

    for (int i = 0; i < 5; i++) {
        guard_remove(g, c[i]);
        close(ends[i][0]);
        close(ends[i][1]);
    }
    CHECK(guard_count(g) == 0);
    guard_free(g);
    return check_result();
}
