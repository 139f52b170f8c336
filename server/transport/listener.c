/* listener.c -- see listener.h. */
#include "server/transport/listener.h"

#include <errno.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "common/clock.h"
#include "common/log.h"
#include "common/mem.h"
#include "server/net/acceptor.h"
#include "server/net/address.h"
#include "server/net/connection_counts.h"
#include "server/net/tls.h"
#include "server/transport/callbacks.h"
#include "server/transport/reply.h"

#define LIBRARY_THREADS 4 /* of libmicrohttpd */
#define QUICK_THREADS 4   /* for handlers that are PACE_QUICK */
#define SLOW_THREADS 8    /* they spend more time waiting for the disk than computing */
/* The acceptor enforces the limit. The library divides its own among its threads; it is set so high that it is never
 * reached. */
#define LIBRARY_LIMIT_FACTOR (2 * LIBRARY_THREADS)
#define POOL_BYTES ((size_t)64 << 10) /* for a connection's head and buffers; a larger head gets 431 */
#define UNSENT_BYTES (256 << 10)      /* of a reply, queued in the kernel for a slow reader */
#define BEGIN_MS 1000                 /* for the library to start on the connections that were accepted */

const char *listener_library_version(void) { return MHD_get_version(); }

uint16_t listener_port(const struct listener *l) { return l->port; }

size_t listener_connections(struct listener *l) { return guard_count(l->guard); }

uint64_t listener_late(struct listener *l) { return guard_shut_count(l->guard); }

static void on_connection(void *user, struct MHD_Connection *connection, void **socket_context,
                          enum MHD_ConnectionNotificationCode code) {
    struct listener *l = user;
    if (code == MHD_CONNECTION_NOTIFY_STARTED) {
        int fd = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD)->connect_fd;
        int unsent = UNSENT_BYTES; /* the default is megabytes for each */
        setsockopt(fd, IPPROTO_TCP, TCP_NOTSENT_LOWAT, &unsent, sizeof unsent);
        *socket_context = guard_add(l->guard, fd);
    } else {
        guard_remove(l->guard, *socket_context);
        *socket_context = NULL;
        struct address from =
            address_of_socket(MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CLIENT_ADDRESS)->client_addr);
        connection_counts_leave(l->connection_counts, &from);
        acceptor_ended(l->acceptor);
    }
}

/* --- starting and stopping --------------------------------------------------------------- */

/* Sends the reason in plain HTTP, and closes. */
static bool turn_away(const struct listener *l, int fd, enum connection_answer answer) {
    static const char *const reply[] = {
        [CONNECTION_ADDRESS_FULL] = "HTTP/1.1 429 Too Many Requests\r\nRetry-After: 30\r\nContent-Type: text/plain\r\n"
                                    "Connection: close\r\n\r\nthis address has reached the limit of its connections; an"
                                    " administrator can raise the option address_max_connections\n",
        [CONNECTION_FULL] = "HTTP/1.1 503 Service Unavailable\r\nRetry-After: 2\r\nContent-Type: text/plain\r\n"
                            "Connection: close\r\n\r\nthe limit of connections is reached; an administrator can"
                            " raise the option max_connections\n"};
    if (!l->tls) /* plain text means nothing to a TLS client */
        (void)!send(fd, reply[answer], strlen(reply[answer]), MSG_NOSIGNAL | MSG_DONTWAIT);
    shutdown(fd, SHUT_WR);
    close(fd);
    return false;
}

static bool on_accepted(void *user, int fd, const struct sockaddr *address, socklen_t size) {
    struct listener *l = user;
    struct address from = address_of_socket(address);
    enum connection_answer answer = connection_counts_enter(l->connection_counts, &from);
    if (answer != CONNECTION_OK)
        return turn_away(l, fd, answer);
    if (MHD_add_connection(l->daemon, fd, address, size) == MHD_YES)
        return true;
    connection_counts_leave(l->connection_counts, &from);
    return false;
}

static void on_tick(void *user) {
    struct listener *l = user;
    l->application.tick(l->application.user, clock_sec());
}

__attribute__((format(printf, 2, 0))) static void log_library(void *user, const char *format, va_list args) {
    (void)user;
    char text[512];
    vsnprintf(text, sizeof text, format, args);
    text[strcspn(text, "\n")] = '\0';
    log_debug("libmicrohttpd: %s", text);
}

enum status listener_reload(struct listener *l, struct error *err) {
    return l->tls ? tls_reload(l->tls, err) : STATUS_OK;
}

static enum status start_library(struct listener *l, const struct listener_config *config, struct error *err) {
    struct MHD_OptionItem tls[] = {
        {MHD_OPTION_HTTPS_CERT_CALLBACK, 0, tls_certificate_callback()},
        {MHD_OPTION_HTTPS_PRIORITIES, 0, TLS_PRIORITIES},
        {MHD_OPTION_END, 0, NULL},
    };
    struct MHD_OptionItem plain[] = {{MHD_OPTION_END, 0, NULL}};
    l->daemon = MHD_start_daemon(MHD_USE_EPOLL_INTERNAL_THREAD | MHD_USE_NO_LISTEN_SOCKET | MHD_ALLOW_SUSPEND_RESUME |
                                     MHD_USE_ITC | MHD_USE_ERROR_LOG | (l->tls ? (unsigned)MHD_USE_TLS : 0),
                                 0, NULL, NULL, callbacks_on_request, l, MHD_OPTION_EXTERNAL_LOGGER, log_library, NULL,
                                 MHD_OPTION_THREAD_POOL_SIZE, (unsigned)LIBRARY_THREADS, MHD_OPTION_CONNECTION_LIMIT,
                                 LIBRARY_LIMIT_FACTOR * config->connection_max, MHD_OPTION_CONNECTION_TIMEOUT,
                                 (unsigned)config->limits.idle_sec, MHD_OPTION_CONNECTION_MEMORY_LIMIT, POOL_BYTES,
                                 MHD_OPTION_URI_LOG_CALLBACK, callbacks_on_target, l, MHD_OPTION_NOTIFY_COMPLETED,
                                 callbacks_on_completed, l, MHD_OPTION_NOTIFY_CONNECTION, on_connection, l,
                                 MHD_OPTION_ARRAY, l->tls ? tls : plain, MHD_OPTION_END);
    return l->daemon ? STATUS_OK : error_set_errno(err, errno, "libmicrohttpd does not start");
}

enum status listener_start(struct listener **out, const struct listener_config *config,
                           const struct application *application, struct error *err) {
    struct listener *l = mem_calloc(1, sizeof *l);
    l->application = *application;
    l->proxies = config->proxies;
    pthread_mutex_init(&l->mutex, NULL);
    pthread_cond_init(&l->changed, NULL);
    l->port = config->port;
    l->connection_counts =
        connection_counts_new(config->connection_max, config->address_connection_max, config->proxies);
    enum status status =
        acceptor_new(&l->acceptor, config->address, &l->port, config->connection_max, on_accepted, l, err);
    if (status == STATUS_OK && config->certificate_file)
        status = tls_new(&l->tls, config->certificate_file, config->key_file, err);
    if (status == STATUS_OK)
        status = guard_new(&l->guard, &config->limits, on_tick, l, err);
    if (status == STATUS_OK)
        status = pool_new(&l->quick, "quick", QUICK_THREADS, err);
    if (status == STATUS_OK)
        status = pool_new(&l->slow, "slow", SLOW_THREADS, err);
    if (status == STATUS_OK)
        status = start_library(l, config, err);
    if (status == STATUS_OK)
        status = acceptor_start(l->acceptor, err);
    if (status != STATUS_OK) {
        listener_stop(l);
        return status;
    }
    *out = l;
    return STATUS_OK;
}

void listener_quiesce(struct listener *l) {
    acceptor_stop(l->acceptor);
    /* The library's threads may not have started on all accepted connections. If one never starts, memory for it was
     * refused. */
    for (int ms = 0; ms < BEGIN_MS && guard_count(l->guard) < acceptor_count(l->acceptor); ms++)
        usleep(1000);
}

/* Waits up to 3 s for *count to become 0. Clients that do not read may take longer. */
static void wait_for_none(struct listener *l, const size_t *count) {
    struct timespec until;
    clock_gettime(CLOCK_MONOTONIC, &until);
    until.tv_sec += 3;
    while (*count > 0 && pthread_cond_clockwait(&l->changed, &l->mutex, CLOCK_MONOTONIC, &until) == 0)
        ;
}

/* Ends the streams and waits until the pools have finished their work: afterwards no connection is suspended, and
 * finished work has been answered. */
static void settle(struct listener *l) {
    pthread_mutex_lock(&l->mutex);
    l->is_closing = true;
    reply_end_streams(l);
    wait_for_none(l, &l->stream_count);
    while (l->working_count > 0)
        pthread_cond_wait(&l->changed, &l->mutex);
    wait_for_none(l, &l->pending_reply_count);
    pthread_mutex_unlock(&l->mutex);
}

void listener_stop(struct listener *l) {
    if (!l)
        return;
    if (l->daemon)
        listener_quiesce(l);
    settle(l);
    if (l->daemon)
        MHD_stop_daemon(l->daemon);
    pool_free(l->quick);
    pool_free(l->slow); /* with the last tasks of exchanges that have just ended */
    acceptor_free(l->acceptor);
    connection_counts_free(l->connection_counts);
    if (l->guard)
        guard_free(l->guard);
    tls_free(l->tls);
    pthread_cond_destroy(&l->changed);
    pthread_mutex_destroy(&l->mutex);
    mem_free(l);
}
