/* listener.c -- see listener.h. */
#include "server/http/listener.h"

#include <errno.h>
#include <fcntl.h>
#include <microhttpd.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "common/clock.h"
#include "common/log.h"
#include "common/mem.h"
#include "server/http/acceptor.h"
#include "server/http/address.h"
#include "server/http/auth.h"
#include "server/http/crowd.h"
#include "server/http/head.h"
#include "server/http/hub.h"
#include "server/http/problem.h"
#include "server/http/routes.h"
#include "server/http/tally.h"
#include "server/http/tls.h"

#define LIBRARY_THREADS 4
#define CLERK_THREADS 4
/* The acceptor keeps to the limit; the library's own, a share of it for each thread, must never be met. */
#define LIBRARY_LIMIT_FACTOR (2 * LIBRARY_THREADS)
#define POOL_BYTES ((size_t)64 << 10)  /* a connection's head and buffers; a larger head gets 431 */
#define UNSENT_BYTES (256 << 10) /* of a reply that wait in the kernel for a slow reader */
#define BEGIN_MS 1000 /* until the library has begun with what was accepted */
#define DRAIN_BYTES ((size_t)64 << 20) /* read and forgotten after a refusal, so that it is seen */

/* One request on its way. Belongs to the library's thread but for the time that a clerk has it. */
struct exchange {
    struct listener *listener;
    struct MHD_Connection *connection;
    struct guarded *guarded;
    struct request request;
    struct error target_error;  /* what is wrong with the request target, if status is set */
    struct response *reply;     /* kept until the library has sent it */
    bool has_begun, has_replied_early;
    bool is_resting;            /* the clerk has it in the middle of its body */
    size_t drained;
    double begun_sec;           /* the request line was there */
    /* Under listener->mutex: */
    bool is_waiting;            /* a stream; suspended until it is woken */
    bool is_woken;              /* while it was not waiting */
    bool is_owed;               /* a clerk's reply, a short one, is on its way */
    struct exchange *next, *previous; /* among the waiting streams, or in the clerks' queue */
};

struct listener {
    struct api *api;
    struct MHD_Daemon *daemon;
    struct guard *guard;
    struct tls *tls; /* NULL: plain HTTP */
    struct acceptor *acceptor; /* has the listening socket */
    struct crowd *crowd;
    uint16_t port;
    pthread_t clerks[CLERK_THREADS];
    size_t clerk_count;
    pthread_mutex_t mutex; /* guards what follows */
    pthread_cond_t changed;
    bool is_closing, clerks_stop;
    struct exchange *waiting;                /* streams, doubly linked */
    struct exchange *queue_first, *queue_last; /* for the clerks, singly linked */
    size_t stream_count;                     /* open, waiting or not */
    size_t owed_count;                       /* exchanges that are owed a reply */
};

const char *listener_library_version(void) {
    return MHD_get_version();
}

uint16_t listener_port(const struct listener *l) {
    return l->port;
}

size_t listener_connections(struct listener *l) {
    return guard_count(l->guard);
}

uint64_t listener_late(struct listener *l) {
    return guard_shut_count(l->guard);
}

/* --- streams ----------------------------------------------------------------------------- */

static void unlink_waiting(struct listener *l, struct exchange *x) {
    if (x->next)
        x->next->previous = x->previous;
    if (x->previous)
        x->previous->next = x->next;
    else
        l->waiting = x->next;
    x->next = x->previous = NULL;
    x->is_waiting = false;
}

static void wake_exchange(void *waker) {
    struct exchange *x = waker;
    struct listener *l = x->listener;
    pthread_mutex_lock(&l->mutex);
    if (x->is_waiting) {
        unlink_waiting(l, x);
        MHD_resume_connection(x->connection);
    } else {
        x->is_woken = true;
    }
    pthread_mutex_unlock(&l->mutex);
}

/* Suspends x's connection unless it was woken meanwhile; false when it has to be read again. */
static bool wait_for_wake(struct exchange *x) {
    struct listener *l = x->listener;
    pthread_mutex_lock(&l->mutex);
    bool waits = !x->is_woken && !l->is_closing;
    x->is_woken = false;
    if (waits) {
        x->is_waiting = true;
        x->next = l->waiting;
        if (l->waiting)
            l->waiting->previous = x;
        l->waiting = x;
        MHD_suspend_connection(x->connection);
    }
    pthread_mutex_unlock(&l->mutex);
    return waits;
}

static bool is_closing(struct listener *l) {
    pthread_mutex_lock(&l->mutex);
    bool closing = l->is_closing;
    pthread_mutex_unlock(&l->mutex);
    return closing;
}

static ssize_t read_stream(void *user, uint64_t position, char *to, size_t size) {
    struct exchange *x = user;
    ssize_t end = position == 0 && x->reply->stream->must_say ? MHD_CONTENT_READER_END_WITH_ERROR
                                                              : MHD_CONTENT_READER_END_OF_STREAM;
    for (;;) {
        if (is_closing(x->listener))
            return end;
        ssize_t got = x->reply->stream->read(x->reply->stream, to, size);
        if (got > 0)
            return got;
        if (got < 0)
            return end;
        if (wait_for_wake(x))
            return 0;
    }
}

static void count_stream(struct listener *l, int change) {
    pthread_mutex_lock(&l->mutex);
    l->stream_count = (size_t)((ssize_t)l->stream_count + change);
    pthread_cond_broadcast(&l->changed);
    pthread_mutex_unlock(&l->mutex);
}

/* --- replies ----------------------------------------------------------------------------- */

static struct MHD_Response *library_response(struct exchange *x) {
    struct response *reply = x->reply;
    if (reply->stream) {
        reply->stream->wake = wake_exchange;
        reply->stream->waker = x;
        count_stream(x->listener, 1);
        return MHD_create_response_from_callback(MHD_SIZE_UNKNOWN, 32768, read_stream, x, NULL);
    }
    if (reply->fd >= 0) {
        struct MHD_Response *made =
            MHD_create_response_from_fd_at_offset64(reply->length, reply->fd, reply->offset);
        if (made)
            reply->fd = -1; /* the library closes it */
        return made;
    }
    /* The text lives until the exchange is over, which the library says afterwards. */
    return MHD_create_response_from_buffer(reply->length, reply->text ? reply->text : "",
                                           MHD_RESPMEM_PERSISTENT);
}

/* A reply that lacks its Location, say, must not look whole. Fields without a value are left out. */
static bool add_fields(const struct exchange *x, struct MHD_Response *made) {
    const struct response *reply = x->reply;
    bool added = MHD_add_response_header(made, "X-Request-Id", x->request.id) == MHD_YES &&
                 MHD_add_response_header(made, "X-Content-Type-Options", "nosniff") == MHD_YES;
    for (size_t i = 0; i < reply->field_count && added; i++)
        added = !*reply->fields[i].value ||
                MHD_add_response_header(made, reply->fields[i].name, reply->fields[i].value) == MHD_YES;
    if (reply->must_close && added)
        added = MHD_add_response_header(made, "Connection", "close") == MHD_YES;
    return added;
}

static enum MHD_Result queue_reply(struct exchange *x) {
    struct response *reply = x->reply;
    struct MHD_Response *made = library_response(x);
    if (!made)
        return MHD_NO;
    if (!add_fields(x, made)) {
        MHD_destroy_response(made);
        return MHD_NO;
    }
    guard_enter(x->listener->guard, x->guarded, GUARD_REPLY);
    enum MHD_Result result = MHD_queue_response(x->connection, (unsigned)reply->status, made);
    MHD_destroy_response(made);
    return result;
}

/* A refusal while the body still comes: the library would close the connection without a word,
 * so the reply goes to the socket past it. What follows is drained for a while, lest the
 * connection be reset before the client has read it. */
static void reply_early(struct exchange *x) {
    bool is_tls = x->listener->tls != NULL;
    const union MHD_ConnectionInfo *info =
        MHD_get_connection_info(x->connection, is_tls ? MHD_CONNECTION_INFO_GNUTLS_SESSION
                                                      : MHD_CONNECTION_INFO_CONNECTION_FD);
    struct response *reply = x->reply;
    struct buf text;
    routes_drop_body(&x->request);
    buf_init(&text, 16384);
    buf_printf(&text, "HTTP/1.1 %d Refused\r\nConnection: close\r\nX-Request-Id: %s\r\nContent-Length: %llu\r\n",
               reply->status, x->request.id, (unsigned long long)reply->length);
    for (size_t i = 0; i < reply->field_count; i++)
        buf_printf(&text, "%s: %s\r\n", reply->fields[i].name, reply->fields[i].value);
    buf_puts(&text, "\r\n");
    buf_append(&text, reply->text, reply->length);
    /* A few hundred bytes into an empty socket buffer; where they do not fit, nobody reads. */
    if (info && is_tls)
        tls_send(info->tls_session, text.data, text.length);
    else if (info)
        (void)!send(info->connect_fd, text.data, text.length, MSG_DONTWAIT | MSG_NOSIGNAL);
    buf_release(&text);
    x->has_replied_early = true;
}

/* --- clerks ------------------------------------------------------------------------------ */

static void *clerk(void *user) {
    struct listener *l = user;
    pthread_mutex_lock(&l->mutex);
    for (;;) {
        while (!l->queue_first && !l->clerks_stop)
            pthread_cond_wait(&l->changed, &l->mutex);
        struct exchange *x = l->queue_first;
        if (!x)
            break;
        l->queue_first = x->next;
        x->next = NULL;
        pthread_mutex_unlock(&l->mutex);
        x->reply = x->is_resting ? routes_rest(l->api, &x->request) : routes_finish(l->api, &x->request);
        pthread_mutex_lock(&l->mutex);
        x->is_owed = x->reply && x->reply->fd < 0;
        l->owed_count += x->is_owed;
        MHD_resume_connection(x->connection);
    }
    pthread_mutex_unlock(&l->mutex);
    return NULL;
}

/* Suspends the connection and gives the exchange to a clerk; false when the daemon is closing. */
static bool give_to_clerk(struct exchange *x) {
    struct listener *l = x->listener;
    pthread_mutex_lock(&l->mutex);
    bool given = !l->is_closing;
    if (given) {
        MHD_suspend_connection(x->connection);
        if (l->queue_first)
            l->queue_last->next = x;
        else
            l->queue_first = x;
        l->queue_last = x;
        pthread_cond_broadcast(&l->changed);
    }
    pthread_mutex_unlock(&l->mutex);
    return given;
}

/* Lets a clerk do what waits for a disk before more of the body is read. */
static void rest(struct exchange *x) {
    guard_enter(x->listener->guard, x->guarded, GUARD_REPLY); /* the client is not to blame */
    x->is_resting = true;
    if (!give_to_clerk(x))
        x->is_resting = false; /* stopping: it is counted when the daemon has stopped */
}

/* --- requests ---------------------------------------------------------------------------- */

static enum MHD_Result take_field(void *user, enum MHD_ValueKind kind, const char *name, size_t name_size,
                                  const char *value, size_t value_size) {
    (void)kind;
    struct request *r = user;
    r->fields = mem_realloc_array(r->fields, r->field_count + 1, sizeof *r->fields);
    struct field *field = &r->fields[r->field_count++];
    field->name = mem_strndup(name, name_size);
    field->value = mem_strndup(value ? value : "", value ? value_size : 0);
    /* A NUL would end the copy early: let it fail the check for control bytes instead. */
    for (size_t i = 0; value && i < value_size; i++)
        if (value[i] == '\0')
            field->value[i] = '\1';
    return MHD_YES;
}

static void take_method(struct request *r, const char *method) {
    static const char *const names[METHOD_COUNT] = {"GET", "POST", "PATCH", "DELETE", "OPTIONS"};
    r->is_head = strcmp(method, "HEAD") == 0;
    r->method = METHOD_GET;
    while (!r->is_head && r->method < METHOD_COUNT && strcmp(method, names[r->method]) != 0)
        r->method++;
}

/* The head is complete: NULL to go on with the body, or the reply. */
static struct response *begin(struct exchange *x, const char *method, const char *version) {
    struct listener *l = x->listener;
    struct request *r = &x->request;
    take_method(r, method);
    MHD_get_connection_values_n(x->connection, MHD_HEADER_KIND, take_field, r);
    struct address peer = address_of_socket(
        MHD_get_connection_info(x->connection, MHD_CONNECTION_INFO_CLIENT_ADDRESS)->client_addr);
    r->address = l->api->config.proxies ? address_of_request(r, &peer, l->api->config.proxies) : peer;
    head_request_id(r);
    const char *length = request_field(r, "Content-Length");
    r->has_body = request_field(r, "Transfer-Encoding") || (length && strcmp(length, "0") != 0);
    r->content_length = length ? strtoll(length, NULL, 10) : r->has_body ? -1 : 0;
    struct response *refusal = head_check(r, version, auth_is_open(l->api) ? l->api->config.server_names : NULL);
    if (!refusal && x->target_error.status != STATUS_OK)
        refusal = problem(r, 400, "%s", x->target_error.message);
    if (!refusal)
        refusal = routes_begin(l->api, r);
    if (refusal)
        routes_drop_body(r);
    if (refusal && r->has_body)
        refusal->must_close = true; /* nobody will read the body */
    if (!refusal && r->has_body)
        guard_enter(l->guard, x->guarded, r->upload || r->patch ? GUARD_BODY : GUARD_SHORT_BODY);
    return refusal;
}

/* More of the body. */
static enum MHD_Result take_body(struct exchange *x, const char *data, size_t *length) {
    struct listener *l = x->listener;
    guard_body(l->guard, x->guarded, *length);
    if (!x->has_replied_early) {
        if (!x->reply) /* a rest may have ended it */
            x->reply = routes_data(l->api, &x->request, data, *length);
        if (x->reply)
            reply_early(x);
        else if (x->request.wants_rest)
            rest(x);
    } else {
        x->drained += *length;
    }
    *length = 0;
    return x->drained > DRAIN_BYTES ? MHD_NO : MHD_YES;
}

static enum MHD_Result on_request(void *user, struct MHD_Connection *connection, const char *url,
                                  const char *method, const char *version, const char *data,
                                  size_t *length, void **context) {
    (void)user, (void)connection, (void)url;
    struct exchange *x = *context;
    struct listener *l = x->listener;
    if (!x->has_begun) {
        x->has_begun = true;
        x->reply = begin(x, method, version);
        return x->reply ? queue_reply(x) : MHD_YES;
    }
    if (x->is_resting) {
        x->is_resting = false;
        guard_enter(l->guard, x->guarded, GUARD_BODY);
    }
    if (*length > 0)
        return take_body(x, data, length);
    if (x->has_replied_early)
        return MHD_NO; /* the reply is sent: close */
    if (x->reply)
        return queue_reply(x); /* a clerk made it */
    guard_enter(l->guard, x->guarded, GUARD_REPLY);
    if (x->request.route->is_slow) {
        if (give_to_clerk(x))
            return MHD_YES;
        x->reply = problem(&x->request, 503, "the daemon is stopping");
    } else {
        x->reply = routes_finish(l->api, &x->request);
    }
    return queue_reply(x);
}

/* The request line is there, not yet decoded: the exchange begins. */
static void *on_target(void *user, const char *target, struct MHD_Connection *connection) {
    struct exchange *x = mem_calloc(1, sizeof *x);
    x->listener = user;
    x->connection = connection;
    x->begun_sec = clock_sec();
    x->guarded = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_SOCKET_CONTEXT)->socket_context;
    target_parse(&x->request.target, target, &x->target_error);
    return x;
}

/* What may have changed something is worth a line; looking is not. */
static void log_request(const struct exchange *x, int status, bool is_whole) {
    static const char *const names[] = {"GET", "POST", "PATCH", "DELETE", "OPTIONS", "other"};
    const struct request *r = &x->request;
    char status_text[8], duration[24], address[ADDRESS_TEXT_SIZE];
    address_text(&r->address, address);
    snprintf(status_text, sizeof status_text, "%d", status);
    snprintf(duration, sizeof duration, "%.1f", 1000.0 * (clock_sec() - x->begun_sec));
    const struct log_field fields[] = {
        {"request", r->id, false},         {"client", address, false},
        {"method", r->is_head ? "HEAD" : names[r->method], false},
        {"path", r->target.path, false},   {"status", status_text, true},
        {"ms", duration, true},            {"user", *r->caller.name ? r->caller.name : NULL, false},
        {"end", is_whole ? NULL : "cut short", false},
    };
    log_fields(r->method == METHOD_GET || r->is_braked ? LOG_DEBUG : LOG_INFO, fields, sizeof fields / sizeof *fields,
               "answered");
}

static void on_completed(void *user, struct MHD_Connection *connection, void **context,
                         enum MHD_RequestTerminationCode code) {
    (void)connection;
    struct listener *l = user;
    struct exchange *x = *context;
    if (!x)
        return;
    *context = NULL;
    pthread_mutex_lock(&l->mutex);
    l->owed_count -= x->is_owed;
    pthread_cond_broadcast(&l->changed);
    pthread_mutex_unlock(&l->mutex);
    int status = x->reply ? x->reply->status : 0;
    tally_add(l->api->tally, &x->request, status);
    log_request(x, status, code == MHD_REQUEST_TERMINATED_COMPLETED_OK);
    bool was_stream = x->reply && x->reply->stream && x->reply->stream->wake;
    response_free(x->reply); /* closes the stream: after this nobody wakes x */
    if (was_stream)
        count_stream(l, -1);
    if (code == MHD_REQUEST_TERMINATED_TIMEOUT_REACHED)
        guard_forsake(x->guarded);
    guard_enter(l->guard, x->guarded, GUARD_IDLE);
    routes_drop_body(&x->request);
    request_release(&x->request);
    mem_free(x);
}

static void on_connection(void *user, struct MHD_Connection *connection, void **socket_context,
                          enum MHD_ConnectionNotificationCode code) {
    struct listener *l = user;
    if (code == MHD_CONNECTION_NOTIFY_STARTED) {
        int fd = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD)->connect_fd;
        int unsent = UNSENT_BYTES; /* megabytes each, otherwise */
        setsockopt(fd, IPPROTO_TCP, TCP_NOTSENT_LOWAT, &unsent, sizeof unsent);
        *socket_context = guard_add(l->guard, fd);
    } else {
        guard_remove(l->guard, *socket_context);
        *socket_context = NULL;
        struct address from =
            address_of_socket(MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CLIENT_ADDRESS)->client_addr);
        crowd_leave(l->crowd, &from);
        acceptor_ended(l->acceptor);
    }
}

/* --- starting and stopping --------------------------------------------------------------- */

/* Says why, to who understands it, and closes. */
static bool turn_away(const struct listener *l, int fd, enum crowd_answer answer) {
    static const char *const reply[] = {
        [CROWD_ADDRESS_FULL] = "HTTP/1.1 429 Too Many Requests\r\nRetry-After: 30\r\nContent-Type: text/plain\r\n"
                               "Connection: close\r\n\r\nthis address has as many connections as one may have; an"
                               " administrator can raise the option address_max_connections\n",
        [CROWD_FULL] = "HTTP/1.1 503 Service Unavailable\r\nRetry-After: 2\r\nContent-Type: text/plain\r\n"
                       "Connection: close\r\n\r\nthere are as many connections as there may be; an administrator can"
                       " raise the option max_connections\n"};
    if (!l->tls) /* whoever is not there to read it has not waited for it */
        (void)!send(fd, reply[answer], strlen(reply[answer]), MSG_NOSIGNAL | MSG_DONTWAIT);
    shutdown(fd, SHUT_WR);
    close(fd);
    return false;
}

static bool on_accepted(void *user, int fd, const struct sockaddr *address, socklen_t size) {
    struct listener *l = user;
    struct address from = address_of_socket(address);
    enum crowd_answer answer = crowd_enter(l->crowd, &from);
    if (answer != CROWD_OK)
        return turn_away(l, fd, answer);
    if (MHD_add_connection(l->daemon, fd, address, size) == MHD_YES)
        return true;
    crowd_leave(l->crowd, &from);
    return false;
}

static void on_tick(void *user) {
    struct listener *l = user;
    hub_tick(l->api->hub, clock_sec());
}

__attribute__((format(printf, 2, 0)))
static void log_library(void *user, const char *format, va_list args) {
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
    l->daemon = MHD_start_daemon(
        MHD_USE_EPOLL_INTERNAL_THREAD | MHD_USE_NO_LISTEN_SOCKET | MHD_ALLOW_SUSPEND_RESUME | MHD_USE_ITC |
            MHD_USE_ERROR_LOG | (l->tls ? (unsigned)MHD_USE_TLS : 0), 0, NULL,
        NULL, on_request, l,
        MHD_OPTION_EXTERNAL_LOGGER, log_library, NULL,
        MHD_OPTION_THREAD_POOL_SIZE, (unsigned)LIBRARY_THREADS,
        MHD_OPTION_CONNECTION_LIMIT, LIBRARY_LIMIT_FACTOR * config->connection_max,
        MHD_OPTION_CONNECTION_TIMEOUT, (unsigned)config->limits.idle_sec,
        MHD_OPTION_CONNECTION_MEMORY_LIMIT, POOL_BYTES,
        MHD_OPTION_URI_LOG_CALLBACK, on_target, l,
        MHD_OPTION_NOTIFY_COMPLETED, on_completed, l,
        MHD_OPTION_NOTIFY_CONNECTION, on_connection, l,
        MHD_OPTION_ARRAY, l->tls ? tls : plain,
        MHD_OPTION_END);
    return l->daemon ? STATUS_OK : error_set_errno(err, errno, "libmicrohttpd does not start");
}

enum status listener_start(struct listener **out, const struct listener_config *config, struct api *api,
                           struct error *err) {
    struct listener *l = mem_calloc(1, sizeof *l);
    l->api = api;
    pthread_mutex_init(&l->mutex, NULL);
    pthread_cond_init(&l->changed, NULL);
    l->port = config->port;
    l->crowd = crowd_new(config->connection_max, config->address_connection_max, api->config.proxies);
    enum status status =
        acceptor_new(&l->acceptor, config->address, &l->port, config->connection_max, on_accepted, l, err);
    if (status == STATUS_OK && config->certificate_file)
        status = tls_new(&l->tls, config->certificate_file, config->key_file, err);
    if (status == STATUS_OK)
        status = guard_new(&l->guard, &config->limits, on_tick, l, err);
    for (; status == STATUS_OK && l->clerk_count < CLERK_THREADS; l->clerk_count++) {
        int failed = pthread_create(&l->clerks[l->clerk_count], NULL, clerk, l);
        if (failed) {
            status = error_set_errno(err, failed, "cannot start a thread");
            break;
        }
    }
    if (status == STATUS_OK)
        status = start_library(l, config, err);
    if (status == STATUS_OK)
        status = acceptor_start(l->acceptor, err);
    if (status != STATUS_OK) {
        listener_stop(l);
        return status;
    }
    api->listener = l;
    *out = l;
    return STATUS_OK;
}

void listener_quiesce(struct listener *l) {
    acceptor_stop(l->acceptor);
    /* The library's threads may not have begun with all that was accepted; if one never does, its memory was refused. */
    for (int ms = 0; ms < BEGIN_MS && guard_count(l->guard) < acceptor_count(l->acceptor); ms++)
        usleep(1000);
}

/* Waits until none is left; for clients that do not read, not long enough; for others, plenty. */
static void wait_for_none(struct listener *l, const size_t *count) {
    struct timespec until;
    clock_gettime(CLOCK_MONOTONIC, &until);
    until.tv_sec += 3;
    while (*count > 0 && pthread_cond_clockwait(&l->changed, &l->mutex, CLOCK_MONOTONIC, &until) == 0)
        ;
}

/* Ends the streams and the clerks' work, and waits for both: nothing is suspended after, and what was done is
 * answered. */
static void settle(struct listener *l) {
    pthread_mutex_lock(&l->mutex);
    l->is_closing = true;
    l->clerks_stop = true;
    pthread_cond_broadcast(&l->changed);
    while (l->waiting) {
        struct exchange *x = l->waiting;
        unlink_waiting(l, x);
        MHD_resume_connection(x->connection);
    }
    wait_for_none(l, &l->stream_count);
    pthread_mutex_unlock(&l->mutex);
    for (size_t i = 0; i < l->clerk_count; i++)
        pthread_join(l->clerks[i], NULL);
    pthread_mutex_lock(&l->mutex);
    wait_for_none(l, &l->owed_count);
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
    acceptor_free(l->acceptor);
    crowd_free(l->crowd);
    if (l->guard)
        guard_free(l->guard);
    tls_free(l->tls);
    l->api->listener = NULL;
    pthread_cond_destroy(&l->changed);
    pthread_mutex_destroy(&l->mutex);
    mem_free(l);
}
