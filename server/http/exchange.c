/* exchange.c -- see exchange.h. */
#include "server/http/exchange.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include "common/clock.h"
#include "common/log.h"
#include "common/mem.h"
#include "server/http/auth.h"
#include "server/http/file_stream.h"
#include "server/http/head.h"
#include "server/http/problem.h"
#include "server/http/request_counts.h"
#include "server/http/routes.h"
#include "server/net/address.h"
#include "server/net/tls.h"

#define PIECE_BYTES ((size_t)256 << 10)      /* of a body that is stored: so much goes to the disk at once, at most */
#define DRAIN_BYTES ((size_t)64 << 20)       /* read and forgotten after a refusal, so that it is seen */
#define EVENT_BLOCK_BYTES ((size_t)32 << 10) /* that the library asks a stream for at once */
#define FILE_BLOCK_BYTES ((size_t)64 << 10)

/* --- to a pool and back ------------------------------------------------------------------ */

/* Suspends the connection and gives the exchange to a pool; false when the daemon is closing. */
static bool give(struct exchange *x, struct pool *pool, void (*run)(struct task *task)) {
    struct listener *l = x->listener;
    pthread_mutex_lock(&l->mutex);
    bool given = !l->is_closing;
    if (given) {
        MHD_suspend_connection(x->connection);
        x->place = EXCHANGE_WITH_POOL;
        x->is_woken = false;
        x->task.run = run;
        l->working_count++;
        pool_give(pool, &x->task);
    }
    pthread_mutex_unlock(&l->mutex);
    return given;
}

/* Gives it back to the library; x is not the caller's any more. The mutex is held. */
static void give_back(struct exchange *x) {
    struct listener *l = x->listener;
    x->place = EXCHANGE_WITH_LIBRARY;
    l->working_count--;
    pthread_cond_broadcast(&l->changed);
    MHD_resume_connection(x->connection);
}

static void done(struct exchange *x) {
    struct listener *l = x->listener;
    pthread_mutex_lock(&l->mutex);
    x->reply_pending = x->reply && x->reply->fd < 0 && !x->reply->stream;
    l->pending_reply_count += x->reply_pending;
    give_back(x);
    pthread_mutex_unlock(&l->mutex);
}

static void finish_task(struct task *task) {
    struct exchange *x = (struct exchange *)task;
    struct api *api = x->listener->api;
    if (x->piece_bytes > 0)
        x->reply = routes_data(api, &x->request, x->piece, x->piece_bytes);
    x->piece_bytes = 0;
    if (!x->reply)
        x->reply = routes_finish(api, &x->request);
    done(x);
}

static struct pool *pool_of(const struct exchange *x) {
    return x->request.route->pace == ROUTE_SLOW ? x->listener->slow : x->listener->quick;
}

static void begin_task(struct task *task) {
    struct exchange *x = (struct exchange *)task;
    x->reply = routes_begin(x->listener->api, &x->request);
    if (x->reply || x->request.has_body) {
        done(x);
    } else if (pool_of(x) == x->listener->slow) {
        x->task.run = finish_task;
        pool_give(x->listener->slow, &x->task);
    } else {
        finish_task(task);
    }
}

static void piece_task(struct task *task) {
    struct exchange *x = (struct exchange *)task;
    x->reply = routes_data(x->listener->api, &x->request, x->piece, x->piece_bytes);
    x->piece_bytes = 0;
    guard_hold(x->listener->guard, x->guarded, false);
    done(x);
}

/* After the exchange: what waits for a disk. What of an upload in parts has come stays with it. */
static void end_task(struct task *task) {
    struct exchange *x = (struct exchange *)task;
    struct listener *l = x->listener;
    bool was_stream = x->reply && x->reply->stream && !x->reply->stream->is_sized;
    if (x->request.patch && x->piece_bytes > 0)
        response_free(routes_data(l->api, &x->request, x->piece, x->piece_bytes));
    response_free(x->reply); /* closes the stream: after this nobody wakes x */
    routes_drop_body(&x->request);
    request_release(&x->request);
    mem_free(x->piece);
    mem_free(x);
    pthread_mutex_lock(&l->mutex);
    l->stream_count -= was_stream;
    pthread_cond_broadcast(&l->changed);
    pthread_mutex_unlock(&l->mutex);
}

/* --- streams ----------------------------------------------------------------------------- */

static void unlink_waiting(struct exchange *x) {
    struct listener *l = x->listener;
    if (x->next)
        x->next->previous = x->previous;
    if (x->previous)
        x->previous->next = x->next;
    else
        l->waiting = x->next;
    x->next = x->previous = NULL;
}

static void fill_task(struct task *task) {
    struct exchange *x = (struct exchange *)task;
    struct listener *l = x->listener;
    bool has_more = x->reply->stream->fill(x->reply->stream);
    pthread_mutex_lock(&l->mutex);
    if (has_more || l->is_closing) {
        give_back(x);
    } else if (x->is_woken) { /* it may have looked too early */
        x->is_woken = false;
        pool_give(l->quick, task);
    } else {
        x->place = EXCHANGE_WAITING;
        l->working_count--;
        pthread_cond_broadcast(&l->changed);
        x->next = l->waiting;
        if (l->waiting)
            l->waiting->previous = x;
        l->waiting = x;
    }
    pthread_mutex_unlock(&l->mutex);
}

static void wake_exchange(void *waker) {
    struct exchange *x = waker;
    struct listener *l = x->listener;
    pthread_mutex_lock(&l->mutex);
    x->is_woken = true;
    if (x->place == EXCHANGE_WAITING) {
        unlink_waiting(x);
        x->place = EXCHANGE_WITH_POOL;
        x->is_woken = false;
        l->working_count++;
        pool_give(l->quick, &x->task);
    }
    pthread_mutex_unlock(&l->mutex);
}

void exchange_wake_all(struct listener *l) {
    while (l->waiting) {
        struct exchange *x = l->waiting;
        unlink_waiting(x);
        l->working_count++;
        give_back(x);
    }
}

static bool is_closing(struct listener *l) {
    pthread_mutex_lock(&l->mutex);
    bool closing = l->is_closing;
    pthread_mutex_unlock(&l->mutex);
    return closing;
}

static ssize_t read_stream(void *user, uint64_t position, char *to, size_t size) {
    struct exchange *x = user;
    struct stream *stream = x->reply->stream;
    bool is_cut = stream->is_sized || (position == 0 && stream->must_say);
    ssize_t end = is_cut ? MHD_CONTENT_READER_END_WITH_ERROR : MHD_CONTENT_READER_END_OF_STREAM;
    ssize_t got = is_closing(x->listener) ? -1 : stream->read(stream, to, size);
    if (got == 0 && give(x, stream->is_sized ? x->listener->slow : x->listener->quick, fill_task))
        return 0;
    return got > 0 ? got : end;
}

/* --- replies ----------------------------------------------------------------------------- */

static struct MHD_Response *library_response(struct exchange *x) {
    struct response *reply = x->reply;
    if (reply->fd >= 0) {
        reply->stream = file_stream_new(reply->fd, reply->offset, reply->length);
        reply->fd = -1;
    } else if (reply->stream) {
        reply->stream->wake = wake_exchange;
        reply->stream->waker = x;
        pthread_mutex_lock(&x->listener->mutex);
        x->listener->stream_count++;
        pthread_mutex_unlock(&x->listener->mutex);
    }
    if (reply->stream && reply->stream->is_sized)
        return MHD_create_response_from_callback(reply->length, FILE_BLOCK_BYTES, read_stream, x, NULL);
    if (reply->stream)
        return MHD_create_response_from_callback(MHD_SIZE_UNKNOWN, EVENT_BLOCK_BYTES, read_stream, x, NULL);
    /* The text lives until the exchange is over, which the library says afterwards. */
    return MHD_create_response_from_buffer(reply->length, reply->text ? reply->text : "", MHD_RESPMEM_PERSISTENT);
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
    const union MHD_ConnectionInfo *info = MHD_get_connection_info(
        x->connection, is_tls ? MHD_CONNECTION_INFO_GNUTLS_SESSION : MHD_CONNECTION_INFO_CONNECTION_FD);
    struct response *reply = x->reply;
    struct buf text;
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

/* A refusal of a head: nobody will read the body. */
static enum MHD_Result refuse(struct exchange *x) {
    if (x->request.has_body)
        x->reply->must_close = true;
    return queue_reply(x);
}

/* The library asks for the first time, or again when a pool has begun with it. A reply to a request without a body
 * is queued when the library comes for it: queued now, it would close the connection. */
static enum MHD_Result go_on_from_head(struct exchange *x) {
    struct request *r = &x->request;
    if (r->has_body && x->reply)
        return refuse(x);
    if (r->has_body)
        guard_enter(x->listener->guard, x->guarded, routes_body_is_stored(r) ? GUARD_BODY : GUARD_SHORT_BODY);
    return MHD_YES;
}

/* The head is complete. */
static enum MHD_Result begin(struct exchange *x, const char *method, const char *version) {
    struct listener *l = x->listener;
    struct request *r = &x->request;
    take_method(r, method);
    MHD_get_connection_values_n(x->connection, MHD_HEADER_KIND, take_field, r);
    struct address peer =
        address_of_socket(MHD_get_connection_info(x->connection, MHD_CONNECTION_INFO_CLIENT_ADDRESS)->client_addr);
    r->address =
        l->api->config.proxies ? address_of_request(r->fields, r->field_count, &peer, l->api->config.proxies) : peer;
    head_request_id(r);
    const char *length = request_field(r, "Content-Length");
    r->has_body = request_field(r, "Transfer-Encoding") || (length && strcmp(length, "0") != 0);
    r->content_length = length ? strtoll(length, NULL, 10) : r->has_body ? -1 : 0;
    struct response *refusal = head_check(r, version, auth_is_open(l->api) ? l->api->config.server_names : NULL);
    if (!refusal && x->target_error.status != STATUS_OK)
        refusal = problem(r, 400, "%s", x->target_error.message);
    if (!refusal)
        refusal = routes_find(r);
    if (!refusal && r->route->pace == ROUTE_AT_ONCE) {
        refusal = routes_begin(l->api, r);
    } else if (!refusal) {
        x->is_beginning = true;
        if (give(x, routes_body_is_stored(r) ? l->slow : l->quick, begin_task))
            return MHD_YES; /* x is a pool's now */
        x->is_beginning = false;
        refusal = problem(r, 503, "the daemon is stopping");
    }
    x->reply = refusal;
    return refusal ? refuse(x) : go_on_from_head(x);
}

static bool is_with_pool(struct exchange *x) {
    pthread_mutex_lock(&x->listener->mutex);
    bool is_so = x->place == EXCHANGE_WITH_POOL;
    pthread_mutex_unlock(&x->listener->mutex);
    return is_so;
}

/* Lets a pool store the piece before more of the body is read. */
static enum MHD_Result give_piece(struct exchange *x) {
    guard_hold(x->listener->guard, x->guarded, true); /* the client is not to blame */
    return give(x, x->listener->slow, piece_task) ? MHD_YES : MHD_NO;
}

static bool has_more_to_read(const struct exchange *x) {
    int fd = MHD_get_connection_info(x->connection, MHD_CONNECTION_INFO_CONNECTION_FD)->connect_fd, waiting = 0;
    return ioctl(fd, FIONREAD, &waiting) == 0 && waiting > 0;
}

/* Bytes of a body that is stored: a piece at a time, or less when no more of it waits, so that what has come counts. Of a chunked body the library
 * hands over the next chunk that it has read even while the connection is suspended: that is left to it. */
static enum MHD_Result collect(struct exchange *x, const char *data, size_t *length) {
    if (is_with_pool(x))
        return MHD_YES;
    if (!x->piece)
        x->piece = mem_alloc(PIECE_BYTES);
    size_t room = PIECE_BYTES - x->piece_bytes, count = *length < room ? *length : room;
    memcpy(x->piece + x->piece_bytes, data, count);
    guard_body(x->listener->guard, x->guarded, count);
    x->piece_bytes += count;
    x->taken += count;
    *length -= count;
    if (x->piece_bytes < PIECE_BYTES && x->request.content_length > 0 &&
        x->taken == (uint64_t)x->request.content_length)
        return MHD_YES; /* the rest goes with the end */
    return x->piece_bytes == PIECE_BYTES || !has_more_to_read(x) ? give_piece(x) : MHD_YES;
}

/* More of the body. */
static enum MHD_Result take_body(struct exchange *x, const char *data, size_t *length) {
    struct listener *l = x->listener;
    if (!x->reply && routes_body_is_stored(&x->request))
        return collect(x, data, length);
    guard_body(l->guard, x->guarded, *length);
    if (!x->reply)
        x->reply = routes_data(l->api, &x->request, data, *length);
    else if (x->has_replied_early)
        x->drained += *length;
    if (x->reply && !x->has_replied_early)
        reply_early(x);
    *length = 0;
    return x->drained > DRAIN_BYTES ? MHD_NO : MHD_YES;
}

/* All of it is there. */
static enum MHD_Result finish(struct exchange *x) {
    guard_enter(x->listener->guard, x->guarded, GUARD_REPLY);
    if (x->request.route->pace == ROUTE_AT_ONCE)
        x->reply = routes_finish(x->listener->api, &x->request);
    else if (give(x, pool_of(x), finish_task))
        return MHD_YES;
    else
        x->reply = problem(&x->request, 503, "the daemon is stopping");
    return queue_reply(x);
}

enum MHD_Result exchange_on_request(void *user, struct MHD_Connection *connection, const char *url, const char *method,
                                    const char *version, const char *data, size_t *length, void **context) {
    (void)user, (void)connection, (void)url;
    struct exchange *x = *context;
    if (!x->has_begun) {
        x->has_begun = true;
        return begin(x, method, version);
    }
    if (x->is_beginning) {
        x->is_beginning = false;
        return go_on_from_head(x);
    }
    if (*length > 0)
        return take_body(x, data, length);
    if (x->has_replied_early)
        return MHD_NO; /* the reply is sent: close */
    return x->reply ? queue_reply(x) : finish(x);
}

void *exchange_on_target(void *user, const char *target, struct MHD_Connection *connection) {
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
        {"request", r->id, false},
        {"client", address, false},
        {"method", r->is_head ? "HEAD" : names[r->method], false},
        {"path", r->target.path, false},
        {"status", status_text, true},
        {"ms", duration, true},
        {"user", *r->caller.name ? r->caller.name : NULL, false},
        {"end", is_whole ? NULL : "cut short", false},
    };
    log_fields(r->method == METHOD_GET || r->is_throttled ? LOG_DEBUG : LOG_INFO, fields,
               sizeof fields / sizeof *fields, "answered");
}

void exchange_on_completed(void *user, struct MHD_Connection *connection, void **context,
                           enum MHD_RequestTerminationCode code) {
    (void)connection;
    struct listener *l = user;
    struct exchange *x = *context;
    if (!x)
        return;
    *context = NULL;
    pthread_mutex_lock(&l->mutex);
    l->pending_reply_count -= x->reply_pending;
    pthread_cond_broadcast(&l->changed);
    pthread_mutex_unlock(&l->mutex);
    int status = x->reply ? x->reply->status : 0;
    request_counts_add(l->api->request_counts, &x->request, status);
    log_request(x, status, code == MHD_REQUEST_TERMINATED_COMPLETED_OK);
    if (code == MHD_REQUEST_TERMINATED_TIMEOUT_REACHED)
        guard_discard_unsent(x->guarded);
    guard_enter(l->guard, x->guarded, GUARD_IDLE);
    bool has_files = x->request.upload || x->request.patch || (x->reply && (x->reply->fd >= 0 || x->reply->stream));
    x->task.run = end_task;
    if (has_files)
        pool_give(l->slow, &x->task);
    else
        end_task(&x->task);
}
