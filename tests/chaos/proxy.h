/* proxy.h -- for long tests: a way to a server that loses what goes over it. One in `one_in` connections is cut, at a
 * random place of what the server answers: that is carried out, and whoever asked does not know. One in `one_in_turned`
 * gets 429, as where an address has too many. */
#ifndef UNBAKE_TESTS_CHAOS_PROXY_H
#define UNBAKE_TESTS_CHAOS_PROXY_H

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <unistd.h>

struct proxy {
    int listener, port, to; /* ports */
    pthread_t thread;
    unsigned one_in, one_in_turned; /* 0: none */
    atomic_uint random;
    atomic_long cut_count, turned_count; /* connections */
    atomic_int open_count;
    atomic_bool is_closing;
};

struct proxy_connection {
    struct proxy *proxy;
    int here, there;
    long left; /* bytes of the answers until it is cut; negative: never */
};

static inline unsigned proxy_draw(struct proxy *p, unsigned limit) {
    unsigned next = atomic_fetch_add(&p->random, 0x9e3779b9u) * 1664525u + 1013904223u;
    next ^= next >> 15;
    next *= 0x846ca68bu;
    return (next >> 8) % limit;
}

/* Moves what there is; false at the end, or where it is to be cut. */
static inline bool proxy_move(struct proxy_connection *c, int from, int to, bool is_answer) {
    char bytes[16384];
    ssize_t got = recv(from, bytes, sizeof bytes, 0);
    if (got <= 0)
        return false;
    if (is_answer && c->left >= 0) {
        got = got < c->left ? got : c->left;
        c->left -= got;
    }
    for (ssize_t done = 0; done < got;) {
        ssize_t sent = send(to, bytes + done, (size_t)(got - done), MSG_NOSIGNAL);
        if (sent <= 0)
            return false;
        done += sent;
    }
    if (is_answer && c->left == 0) {
        atomic_fetch_add(&c->proxy->cut_count, 1);
        return false;
    }
    return true;
}

static inline void *proxy_serve(void *user) {
    struct proxy_connection *c = user;
    bool is_open = true;
    while (is_open && !atomic_load(&c->proxy->is_closing)) {
        struct pollfd fds[2] = {{.fd = c->here, .events = POLLIN}, {.fd = c->there, .events = POLLIN}};
        if (poll(fds, 2, 200) <= 0)
            continue;
        if (fds[1].revents)
            is_open = proxy_move(c, c->there, c->here, true);
        if (is_open && fds[0].revents)
            is_open = proxy_move(c, c->here, c->there, false);
    }
    close(c->here);
    close(c->there);
    atomic_fetch_sub(&c->proxy->open_count, 1);
    free(c);
    return NULL;
}

static inline void proxy_turn_away(struct proxy *p, int fd) {
    static const char reply[] =
        "HTTP/1.1 429 Too Many Requests\r\nContent-Type: text/plain\r\nConnection: close\r\n\r\nfull\n";
    char bytes[16384];
    (void)!recv(fd, bytes, sizeof bytes, 0);
    (void)!send(fd, reply, sizeof reply - 1, MSG_NOSIGNAL);
    shutdown(fd, SHUT_WR);
    (void)!recv(fd, bytes, sizeof bytes, 0);
    close(fd);
    atomic_fetch_add(&p->turned_count, 1);
}

static inline void *proxy_accept(void *user) {
    struct proxy *p = user;
    while (!atomic_load(&p->is_closing)) {
        struct pollfd wait = {.fd = p->listener, .events = POLLIN};
        int here = poll(&wait, 1, 200) == 1 ? accept4(p->listener, NULL, NULL, SOCK_CLOEXEC) : -1;
        if (here < 0)
            continue;
        if (p->one_in_turned > 0 && proxy_draw(p, p->one_in_turned) == 0) {
            proxy_turn_away(p, here);
            continue;
        }
        struct proxy_connection *c = calloc(1, sizeof *c);
        struct sockaddr_in to = {
            .sin_family = AF_INET, .sin_port = htons((uint16_t)p->to), .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
        *c = (struct proxy_connection){.proxy = p, .here = here, .left = -1};
        c->there = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
        if (p->one_in > 0 && proxy_draw(p, p->one_in) == 0)
            c->left = 26 + (long)proxy_draw(p, 4000); /* a kept connection has several answers; "100 Continue" has 25 */
        pthread_t thread;
        if (connect(c->there, (struct sockaddr *)&to, sizeof to) != 0) {
            close(c->here);
            close(c->there);
            free(c);
            continue;
        }
        atomic_fetch_add(&p->open_count, 1);
        pthread_create(&thread, NULL, proxy_serve, c);
        pthread_detach(thread);
    }
    return NULL;
}

static inline void proxy_start(struct proxy *p, int to, unsigned one_in, unsigned one_in_turned, unsigned seed) {
    struct sockaddr_in own = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof own;
    *p = (struct proxy){.to = to, .one_in = one_in, .one_in_turned = one_in_turned};
    atomic_store(&p->random, seed);
    p->listener = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (bind(p->listener, (struct sockaddr *)&own, sizeof own) != 0 || listen(p->listener, 64) != 0 ||
        getsockname(p->listener, (struct sockaddr *)&own, &size) != 0)
        abort();
    p->port = ntohs(own.sin_port);
    pthread_create(&p->thread, NULL, proxy_accept, p);
}

static inline void proxy_stop(struct proxy *p) {
    atomic_store(&p->is_closing, true);
    pthread_join(p->thread, NULL);
    while (atomic_load(&p->open_count) > 0)
        usleep(10000);
    close(p->listener);
}

#endif
