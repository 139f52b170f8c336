/* Clients that are slow on purpose: each is cut off by its deadline while it still sends, and the
 * others are served meanwhile. The library's own timeout never trips here. */
#include "tests/api/rig.h"

#define DRIPS_MOST 400

/* Sends a byte of `drip` after the other, 20 a second, until the daemon closes or it was patient for too
 * long. */
static bool is_closed_while_dripping(int fd, const char *drip) {
    bool closed = false;
    for (int i = 0; i < DRIPS_MOST && !closed; i++) {
        char byte;
        usleep(50000);
        rig_send(fd, drip + i % (int)strlen(drip), 1);
        closed = recv(fd, &byte, 1, MSG_DONTWAIT | MSG_PEEK) == 0;
    }
    return closed;
}

/* The same on a connection of its own, after `head`. */
static bool is_cut_off(const struct rig *rig, const char *head, const char *drip) {
    int fd = rig_connect(rig);
    rig_send(fd, head, strlen(head));
    bool closed = is_closed_while_dripping(fd, drip);
    close(fd);
    return closed;
}

static void check_slow(const struct rig *rig) {
    /* A crowd that sends its heads slowly, and never ends. */
    enum { CROWD = 100 };
    struct buf reply;
    int crowd[CROWD];
    for (int i = 0; i < CROWD; i++) {
        crowd[i] = rig_connect(rig);
        rig_send(crowd[i], "GET /healthz HTTP/1.1\r\nX: ", 26);
    }
    CHECK(rig_get(rig, "/healthz", "", &reply) == 200);
    buf_release(&reply);
    CHECK(is_cut_off(rig, "GET /healthz HTTP/1.1\r\nHost: localhost\r\n", "X: y\r\n"));
    for (int i = 0; i < CROWD; i++) {
        char byte;
        CHECK(recv(crowd[i], &byte, 1, 0) <= 0);
        close(crowd[i]);
    }
    /* A connection that never says a word. */
    CHECK(is_cut_off(rig, "", "\n"));
    /* A body of 20 bytes a second. */
    CHECK(is_cut_off(rig, "POST /v1/scenes HTTP/1.1\r\nHost: localhost\r\nContent-Length: 100000\r\n\r\n", "x"));
    CHECK(is_cut_off(rig, "POST /v1/jobs HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
                          "Content-Length: 100000\r\n\r\n", " "));
    CHECK(listener_late(rig->listener) >= CROWD + 3);
}

/* A second request on a kept connection has its deadline too. */
static void check_second_request(const struct rig *rig) {
    static const char request[] = "GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n";
    struct buf reply;
    int fd = rig_connect(rig);
    buf_init(&reply, 1 << 16);
    rig_send(fd, request, sizeof request - 1);
    rig_receive(fd, &reply, "\"ok\"}\n");
    CHECK(rig_status(&reply) == 200);
    CHECK(is_closed_while_dripping(fd, "G"));
    close(fd);
    buf_release(&reply);
}

/* Too large a body, of which the end never comes: the refusal is seen all the same. */
static void check_large_body(const struct rig *rig) {
    static const char head[] = "POST /v1/jobs HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
                               "Transfer-Encoding: chunked\r\n\r\n";
    struct buf reply;
    int fd = rig_connect(rig);
    buf_init(&reply, 1 << 16);
    rig_send(fd, head, sizeof head - 1);
    char *chunk = mem_printf("%x\r\n%65536s\r\n", 65536, "");
    for (int i = 0; i < 20; i++)
        rig_send(fd, chunk, strlen(chunk));
    rig_receive(fd, &reply, "urn:unbake:too-large");
    CHECK(rig_status(&reply) == 413);
    mem_free(chunk);
    close(fd);
    buf_release(&reply);
}

int main(void) {
    struct rig rig;
    struct guard_limits limits = {.head_sec = 1, .idle_sec = 3, .window_sec = 1, .body_bytes_per_sec = 1000};
    rig_start(&rig, &limits, 15);
    check_slow(&rig);
    check_second_request(&rig);
    check_large_body(&rig);
    rig_stop(&rig);
    return check_result();
}
