/* Deadlines: who is shut down when, with the time as a parameter. */
#include "common/clock.h"
#include "server/http/guard.h"

#include <sys/socket.h>

#include "tests/check.h"

/* True once the other end of the pair sees that its partner was shut down. */
static int is_shut(int fd) {
    char byte;
    return recv(fd, &byte, 1, MSG_DONTWAIT) == 0;
}

int main(void) {
    /* Real time never counts here: the limits are longer than the test by far. */
    struct guard_limits limits = {.head_sec = 1000, .idle_sec = 5000, .window_sec = 3000, .body_bytes_per_sec = 10};
    struct guard *g;
    struct error err;
    struct guarded *c[4];
    int ends[4][2];
    CHECK(guard_new(&g, &limits, NULL, NULL, &err) == STATUS_OK);
    for (int i = 0; i < 4; i++) {
        CHECK(socketpair(AF_UNIX, SOCK_STREAM, 0, ends[i]) == 0);
        c[i] = guard_add(g, ends[i][0]);
    }
    CHECK(guard_count(g) == 4);
    double now = clock_sec();
    guard_enter(g, c[1], GUARD_BODY);
    guard_enter(g, c[2], GUARD_REPLY);
    guard_enter(g, c[3], GUARD_IDLE);

    guard_look(g, now + 990);
    CHECK(guard_shut_count(g) == 0);
    guard_look(g, now + 1010); /* the head took too long */
    CHECK(is_shut(ends[0][1]) && guard_shut_count(g) == 1);
    guard_look(g, now + 1020); /* and is counted once */
    CHECK(guard_shut_count(g) == 1);

    guard_body(g, c[1], 31000); /* more than 10 bytes/s over the first window */
    guard_look(g, now + 3010);
    CHECK(!is_shut(ends[1][1]));
    guard_body(g, c[1], 29000); /* less over the second */
    guard_look(g, now + 6000);
    CHECK(!is_shut(ends[1][1]));
    CHECK(!is_shut(ends[3][1])); /* idle may last its time and a head's */
    guard_look(g, now + 6020);
    CHECK(is_shut(ends[1][1]) && is_shut(ends[3][1]));
    guard_look(g, now + 1e9);
    CHECK(!is_shut(ends[2][1]) && guard_shut_count(g) == 3); /* a reply has no deadline here */

    for (int i = 0; i < 4; i++) {
        guard_remove(g, c[i]);
        close(ends[i][0]);
        close(ends[i][1]);
    }
    CHECK(guard_count(g) == 0);
    guard_free(g);
    return check_result();
}
