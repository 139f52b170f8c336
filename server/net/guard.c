/* guard.c -- see guard.h. */
#include "server/net/guard.h"

#include <linux/sockios.h>
#include <linux/tcp.h>
#include <netinet/in.h>
#include <stdbool.h>
#include <stddef.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include "common/background.h"
#include "common/clock.h"
#include "common/mem.h"

struct guarded {
    int fd;
    enum guard_phase phase;
    double phase_sec;      /* start of the phase */
    double since_sec;      /* start of the window */
    uint64_t window_bytes; /* bytes that arrived in the window; in GUARD_REPLY: bytes acknowledged before it */
    bool has_backlog;      /* GUARD_REPLY: a window has begun */
    bool is_shut;
    double held_sec; /* since when it is held; 0: not held */
    struct guarded *next, *previous;
};

struct guard {
    struct guard_limits limits;
    void (*tick)(void *user);
    void *user;
    struct background thread; /* its mutex guards everything below */
    struct guarded *first;
    size_t count;
    uint64_t shut_count;
};

/* Bytes that the peer has acknowledged in all; false when none are outstanding, or the socket is not TCP. */
static bool look_at_backlog(int fd, uint64_t *taken) {
    struct tcp_info info = {0};
    socklen_t size = sizeof info;
    int waiting = 0;
    if (ioctl(fd, SIOCOUTQ, &waiting) != 0 || waiting == 0 ||
        getsockopt(fd, IPPROTO_TCP, TCP_INFO, &info, &size) != 0 ||
        size < offsetof(struct tcp_info, tcpi_bytes_acked) + sizeof info.tcpi_bytes_acked)
        return false;
    *taken = info.tcpi_bytes_acked;
    return true;
}

static bool reader_is_late(const struct guard *g, struct guarded *c, double now_sec) {
    uint64_t taken;
    bool had_backlog = c->has_backlog;
    c->has_backlog = look_at_backlog(c->fd, &taken);
    if (!c->has_backlog || (had_backlog && now_sec - c->since_sec < g->limits.window_sec))
        return false;
    double age = now_sec - c->since_sec;
    bool late = had_backlog && (double)(taken - c->window_bytes) < g->limits.body_bytes_per_sec * age;
    c->since_sec = now_sec;
    c->window_bytes = taken;
    return late;
}

static bool is_late(const struct guard *g, struct guarded *c, double now_sec) {
    double age = now_sec - c->since_sec;
    switch (c->phase) {
    case GUARD_HEAD: return age > g->limits.head_sec;
    case GUARD_IDLE: return age > g->limits.idle_sec + g->limits.head_sec;
    case GUARD_REPLY: return reader_is_late(g, c, now_sec);
    case GUARD_SHORT_BODY:
        if (now_sec - c->phase_sec > g->limits.idle_sec)
            return true;
        break;
    case GUARD_BODY: break;
    }
    if (age < g->limits.window_sec)
        return false;
    bool late = (double)c->window_bytes < g->limits.body_bytes_per_sec * age;
    c->since_sec = now_sec;
    c->window_bytes = 0;
    return late;
}

void guard_discard_unsent(struct guarded *c) {
    struct linger none = {.l_onoff = 1};
    setsockopt(c->fd, SOL_SOCKET, SO_LINGER, &none, sizeof none);
}

void guard_check_all(struct guard *g, double now_sec) {
    pthread_mutex_lock(&g->thread.mutex);
    for (struct guarded *c = g->first; c; c = c->next) {
        if (c->is_shut || c->held_sec > 0.0 || !is_late(g, c, now_sec))
            continue;
        if (c->phase == GUARD_REPLY)
            guard_discard_unsent(c);
        c->is_shut = true;
        g->shut_count++;
        shutdown(c->fd, SHUT_RDWR);
    }
    pthread_mutex_unlock(&g->thread.mutex);
}

static void *run(void *user) {
    struct guard *g = user;
    pthread_mutex_lock(&g->thread.mutex);
    while (!atomic_load(&g->thread.stopping)) {
        if (g->count == 0) {
            pthread_cond_wait(&g->thread.changed, &g->thread.mutex);
            continue;
        }
        double until_sec = clock_sec() + 1.0;
        while (!atomic_load(&g->thread.stopping) && background_wait_until(&g->thread, until_sec))
            ; /* woken by a connection that came or went: the second is not over */
        pthread_mutex_unlock(&g->thread.mutex);
        guard_check_all(g, clock_sec());
        if (g->tick)
            g->tick(g->user);
        pthread_mutex_lock(&g->thread.mutex);
    }
    pthread_mutex_unlock(&g->thread.mutex);
    return NULL;
}

enum status guard_new(struct guard **out, const struct guard_limits *limits, void (*tick)(void *user), void *user,
                      struct error *err) {
    struct guard *g = mem_calloc(1, sizeof *g);
    g->limits = *limits;
    g->tick = tick;
    g->user = user;
    enum status status = background_start(&g->thread, run, g, "watches connections", err);
    *out = status == STATUS_OK ? g : NULL;
    if (status != STATUS_OK)
        mem_free(g);
    return status;
}

void guard_free(struct guard *g) {
    if (!g)
        return;
    background_stop(&g->thread);
    mem_free(g);
}

struct guarded *guard_add(struct guard *g, int fd) {
    struct guarded *c = mem_calloc(1, sizeof *c);
    c->fd = fd;
    c->phase = GUARD_HEAD;
    c->since_sec = clock_sec();
    pthread_mutex_lock(&g->thread.mutex);
    c->next = g->first;
    if (g->first)
        g->first->previous = c;
    g->first = c;
    if (g->count++ == 0)
        pthread_cond_signal(&g->thread.changed);
    pthread_mutex_unlock(&g->thread.mutex);
    return c;
}

void guard_remove(struct guard *g, struct guarded *c) {
    pthread_mutex_lock(&g->thread.mutex);
    if (c->next)
        c->next->previous = c->previous;
    if (c->previous)
        c->previous->next = c->next;
    else
        g->first = c->next;
    g->count--;
    pthread_mutex_unlock(&g->thread.mutex);
    mem_free(c);
}

void guard_enter(struct guard *g, struct guarded *c, enum guard_phase phase) {
    pthread_mutex_lock(&g->thread.mutex);
    c->phase = phase;
    c->phase_sec = c->since_sec = clock_sec();
    c->window_bytes = 0;
    c->has_backlog = false;
    c->held_sec = 0.0;
    pthread_mutex_unlock(&g->thread.mutex);
}

void guard_hold(struct guard *g, struct guarded *c, bool is_held) {
    double now = clock_sec();
    pthread_mutex_lock(&g->thread.mutex);
    if (!is_held && c->held_sec > 0.0) {
        c->phase_sec += now - c->held_sec;
        c->since_sec += now - c->held_sec;
    }
    c->held_sec = is_held ? now : 0.0;
    pthread_mutex_unlock(&g->thread.mutex);
}

void guard_body(struct guard *g, struct guarded *c, size_t bytes) {
    pthread_mutex_lock(&g->thread.mutex);
    c->window_bytes += bytes;
    pthread_mutex_unlock(&g->thread.mutex);
}

size_t guard_count(struct guard *g) {
    pthread_mutex_lock(&g->thread.mutex);
    size_t count = g->count;
    pthread_mutex_unlock(&g->thread.mutex);
    return count;
}

uint64_t guard_shut_count(struct guard *g) {
    pthread_mutex_lock(&g->thread.mutex);
    uint64_t count = g->shut_count;
    pthread_mutex_unlock(&g->thread.mutex);
    return count;
}
