/* acceptor.c -- see acceptor.h. */
#include "server/net/acceptor.h"

#include <errno.h>
#include <poll.h>
#include <pthread.h>
#include <stdatomic.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "common/log.h"
#include "common/mem.h"
#include "server/net/bind.h"

#define PAUSE_MS 100 /* before another try when descriptors or memory have run out */

struct acceptor {
    int listen_fd; /* -1: none, or stopped */
    int wake_fd;   /* an eventfd: there is room again, or the thread must stop */
    size_t connection_max;
    acceptor_take *take;
    void *user;
    atomic_size_t count;
    atomic_bool stopping;
    bool is_in_trouble; /* the thread's own: the last try failed */
    bool runs;          /* the thread was started */
    pthread_t thread;
};

/* Returns whether the next connection may be tried at once. */
static bool take_one(struct acceptor *a) {
    struct sockaddr_storage address;
    socklen_t size = sizeof address;
    int fd = accept4(a->listen_fd, (struct sockaddr *)&address, &size, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (fd >= 0) {
        atomic_fetch_add(&a->count, 1); /* counted first: the connection may end before take() returns */
        if (!a->take(a->user, fd, (struct sockaddr *)&address, size))
            atomic_fetch_sub(&a->count, 1);
        a->is_in_trouble = false;
        return true;
    }
    if (errno != EMFILE && errno != ENFILE && errno != ENOBUFS && errno != ENOMEM)
        return true; /* the connection's own fault, or none is waiting */
    if (!a->is_in_trouble) {
        struct error err;
        error_set_errno(&err, errno, "cannot accept connections for now");
        log_warning("%s", err.message);
    }
    a->is_in_trouble = true;
    return false;
}

static void *run(void *user) {
    struct acceptor *a = user;
    bool pauses = false;
    while (!atomic_load(&a->stopping)) {
        bool has_room = atomic_load(&a->count) < a->connection_max;
        struct pollfd fds[] = {{.fd = a->wake_fd, .events = POLLIN},
                               {.fd = has_room && !pauses ? a->listen_fd : -1, .events = POLLIN}};
        if (poll(fds, 2, pauses ? PAUSE_MS : -1) < 0)
            continue;
        eventfd_t times;
        if (fds[0].revents)
            eventfd_read(a->wake_fd, &times);
        pauses = fds[1].revents && !take_one(a);
    }
    return NULL;
}

enum status acceptor_new(struct acceptor **out, const char *address, uint16_t *port, size_t connection_max,
                         acceptor_take *take, void *user, struct error *err) {
    struct acceptor *a = mem_calloc(1, sizeof *a);
    a->connection_max = connection_max;
    a->take = take;
    a->user = user;
    a->listen_fd = a->wake_fd = -1;
    enum status status = bind_listen(&a->listen_fd, address, port, err);
    if (status == STATUS_OK && (a->wake_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) < 0)
        status = error_set_errno(err, errno, "cannot make an eventfd");
    if (status == STATUS_OK)
        *out = a;
    else
        acceptor_free(a);
    return status;
}

enum status acceptor_start(struct acceptor *a, struct error *err) {
    int failed = pthread_create(&a->thread, NULL, run, a);
    a->runs = !failed;
    return failed ? error_set_errno(err, failed, "cannot start the thread that accepts connections") : STATUS_OK;
}

void acceptor_ended(struct acceptor *a) {
    if (atomic_fetch_sub(&a->count, 1) == a->connection_max)
        eventfd_write(a->wake_fd, 1);
}

size_t acceptor_count(struct acceptor *a) { return atomic_load(&a->count); }

void acceptor_stop(struct acceptor *a) {
    if (a->runs) {
        atomic_store(&a->stopping, true);
        eventfd_write(a->wake_fd, 1);
        pthread_join(a->thread, NULL);
        a->runs = false;
    }
    if (a->listen_fd >= 0)
        close(a->listen_fd);
    a->listen_fd = -1;
}

void acceptor_free(struct acceptor *a) {
    if (!a)
        return;
    acceptor_stop(a);
    if (a->wake_fd >= 0)
        close(a->wake_fd);
    mem_free(a);
}
