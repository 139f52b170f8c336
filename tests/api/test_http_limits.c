/* Clients that are slow on purpose: each is cut off by its deadline while it still sends, and the
 * others are served meanwhile. The library's own timeout never trips here. */
#include "tests/api/rig.h"

#define PATIENCE 1200 /* of 50 ms */
#define CROWD 100

/* A connection that sends a byte of `drip` after the other, 20 a second. */
struct slow {
    const char *head, *drip; /* `head` at once, before */
    int fd;
    bool is_closed; /* by the daemon */
};

/* Until the daemon has closed them all, or it was patient for too long. */
static void drip_all(struct slow *slow, size_t count) {
    size_t open = count;
    for (int i = 0; i < PATIENCE && open > 0; i++) {
        usleep(50000);
        for (size_t k = 0; k < count; k++) {
            struct slow *s = &slow[k];
            char byte;
            if (s->is_closed)
                continue;
            rig_send(s->fd, s->drip + i % (int)strlen(s->drip), 1);
            s->is_closed = recv(s->fd, &byte, 1, MSG_DONTWAIT | MSG_PEEK) == 0;
            open -= s->is_closed;
        }
    }
}

/* A second request on a kept connection has its deadline too: this one has had its first reply. */
static int connect_again(const struct rig *rig) {
    static const char request[] = "GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n";
    struct buf reply;
    int fd = rig_connect(rig);
    buf_init(&reply, 1 << 16);
    rig_send(fd, request, sizeof request - 1);
    rig_receive(fd, &reply, "\"ok\"}\n");
    CHECK(rig_status(&reply) == 200);
    buf_release(&reply);
    return fd;
}

static void check_slow(const struct rig *rig) {
    struct slow slow[] = {
        {.head = "GET /healthz HTTP/1.1\r\nHost: localhost\r\n", .drip = "X: y\r\n"},
        {.head = "", .drip = "\n"}, /* it never says a word */
        /* bodies of 20 bytes a second */
        {.head = "POST /v1/scenes HTTP/1.1\r\nHost: localhost\r\nContent-Length: 100000\r\n\r\n", .drip = "x"},
        {.head = "POST /v1/jobs HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
                 "Content-Length: 100000\r\n\r\n",
         .drip = " "},
        {.head = NULL, .drip = "G"}, /* a second request */
    };
    const size_t count = sizeof slow / sizeof *slow;
    /* A crowd that sends its heads slowly, and never ends. */
    struct buf reply;
    int crowd[CROWD];
    for (int i = 0; i < CROWD; i++) {
        crowd[i] = rig_connect(rig);
        rig_send(crowd[i], "GET /healthz HTTP/1.1\r\nX: ", 26);
    }
    for (size_t k = 0; k < count; k++) {
        slow[k].fd = slow[k].head ? rig_connect(rig) : connect_again(rig);
        if (slow[k].head)
            rig_send(slow[k].fd, slow[k].head, strlen(slow[k].head));
    }
    CHECK(rig_get(rig, "/healthz", "", &reply) == 200);
    buf_release(&reply);
    drip_all(slow, count);
    for (size_t k = 0; k < count; k++) {
        CHECK_THAT(slow[k].is_closed, "the one with \"%s\" is not cut off",
                   slow[k].head ? slow[k].head : "a second request");
        close(slow[k].fd);
    }
    for (int i = 0; i < CROWD; i++) {
        char byte;
        CHECK(recv(crowd[i], &byte, 1, 0) <= 0);
        close(crowd[i]);
    }
    CHECK_THAT(listener_late(rig->listener) >= CROWD + 3, "%lu were late", (unsigned long)listener_late(rig->listener));
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
    struct guard_limits limits = {.head_sec = 3, .idle_sec = 8, .window_sec = 3, .body_bytes_per_sec = 1000};
    rig_start(&rig, &limits, 15);
    check_slow(&rig);
    rig_stop(&rig);
    rig_start(&rig, &rig_patient, 15);
    check_large_body(&rig);
    rig_stop(&rig);
    return check_result();
}
