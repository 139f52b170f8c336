/* Clients that are slow on purpose: each is cut off by its deadline while it still sends, and the
 * others are served meanwhile. The library's own timeout never trips here. */
#include "tests/api/rig.h"

/* Sends `head` at once and then a byte of `drip` after the other, until the daemon closes.
 * True when it did so before `most` bytes were sent. */
static bool is_cut_off(const struct rig *rig, const char *head, const char *drip, int most) {
    int fd = rig_connect(rig);
    rig_send(fd, head, strlen(head));
    bool closed = false;
    for (int i = 0; i < most && !closed; i++) {
        char byte;
        usleep(50000);
        rig_send(fd, drip + i % (int)strlen(drip), 1);
        closed = recv(fd, &byte, 1, MSG_DONTWAIT | MSG_PEEK) == 0;
    }
    close(fd);
    return closed;
}

int main(void) {
    struct rig rig;
    struct buf reply;
    struct guard_limits limits = {.head_sec = 1, .idle_sec = 3, .window_sec = 1, .body_bytes_per_sec = 1000};
    rig_start(&rig, &limits, 15);
    /* A crowd that sends its heads slowly, and never ends. */
    enum { CROWD = 100 };
    int crowd[CROWD];
    for (int i = 0; i < CROWD; i++) {
        crowd[i] = rig_connect(&rig);
        rig_send(crowd[i], "GET /healthz HTTP/1.1\r\nX: ", 26);
    }
    CHECK(rig_get(&rig, "/healthz", "", &reply) == 200);
    buf_release(&reply);
    CHECK(is_cut_off(&rig, "GET /healthz HTTP/1.1\r\nHost: localhost\r\n", "X: y\r\n", 400));
    for (int i = 0; i < CROWD; i++) {
        char byte;
        CHECK(recv(crowd[i], &byte, 1, 0) <= 0);
        close(crowd[i]);
    }
    /* A connection that never says a word. */
    CHECK(is_cut_off(&rig, "", "\n", 400));
    /* A body of 20 bytes a second. */
    CHECK(is_cut_off(&rig, "POST /v1/scenes HTTP/1.1\r\nHost: localhost\r\nContent-Length: 100000\r\n\r\n", "x", 400));
    CHECK(is_cut_off(&rig, "POST /v1/jobs HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
                           "Content-Length: 100000\r\n\r\n", " ", 400));
    CHECK(listener_late(rig.listener) >= CROWD + 3);
    /* A second request on a kept connection has its deadline too. */
    int fd = rig_connect(&rig);
    static const char request[] = "GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n";
    buf_init(&reply, 1 << 16);
    rig_send(fd, request, sizeof request - 1);
    rig_receive(fd, &reply, "\"ok\"}\n");
    CHECK(rig_status(&reply) == 200);
    bool closed = false;
    for (int i = 0; i < 400 && !closed; i++) {
        char byte;
        usleep(50000);
        rig_send(fd, i == 0 ? "G" : "E", 1);
        closed = recv(fd, &byte, 1, MSG_DONTWAIT | MSG_PEEK) == 0;
    }
    CHECK(closed);
    close(fd);
    buf_release(&reply);

    /* Too large a body, of which the end never comes: the refusal is seen all the same. */
    fd = rig_connect(&rig);
    buf_init(&reply, 1 << 16);
    static const char head[] = "POST /v1/jobs HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
                               "Transfer-Encoding: chunked\r\n\r\n";
    rig_send(fd, head, sizeof head - 1);
    char *chunk = mem_printf("%x\r\n%65536s\r\n", 65536, "");
    for (int i = 0; i < 20; i++)
        rig_send(fd, chunk, strlen(chunk));
    rig_receive(fd, &reply, "urn:unbake:too-large");
    CHECK(rig_status(&reply) == 413);
    mem_free(chunk);
    close(fd);
    buf_release(&reply);
    rig_stop(&rig);
    return check_result();
}
