/* callbacks.c -- see callbacks.h. */
#include "server/transport/callbacks.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>

#include "common/clock.h"
#include "common/log.h"
#include "common/mem.h"
#include "server/net/address.h"
#include "server/transport/head.h"
#include "server/transport/problem.h"
#include "server/transport/reply.h"

#define PIECE_BYTES ((size_t)256 << 10) /* of a stored body: at most this much is written to disk at once */
#define DRAIN_BYTES ((size_t)64 << 20)  /* of a body that are read and dropped after an early refusal */

static enum MHD_Result take_field(void *user, enum MHD_ValueKind kind, const char *name, size_t name_size,
                                  const char *value, size_t value_size) {
    (void)kind;
    struct request *r = user;
    r->fields = mem_realloc_array(r->fields, r->field_count + 1, sizeof *r->fields);
    struct field *field = &r->fields[r->field_count++];
    field->name = mem_strndup(name, name_size);
    field->value = mem_strndup(value ? value : "", value ? value_size : 0);
    /* A NUL would cut the value short unnoticed; as a control byte it fails head_check. */
    for (size_t i = 0; value && i < value_size; i++)
        if (value[i] == '\0')
            field->value[i] = '\1';
    return MHD_YES;
}

static void take_method(struct request *r, const char *method) {
    static const char *const names[METHOD_COUNT] = {"GET", "POST", "PATCH", "DELETE", "OPTIONS", "PUT"};
    r->is_head = strcmp(method, "HEAD") == 0;
    r->method = METHOD_GET;
    while (!r->is_head && r->method < METHOD_COUNT && strcmp(method, names[r->method]) != 0)
        r->method++;
}

/* Refuses a request by its head; its body will not be read. */
static enum MHD_Result refuse(struct exchange *x) {
    if (x->request.has_body)
        x->reply->must_close = true;
    return reply_queue(x);
}

/* The head has been worked on: refuses the request or lets its body arrive. A reply to a request without a body is
 * queued at the library's next call; queued now, it would close the connection. */
static enum MHD_Result accept_body(struct exchange *x) {
    struct request *r = &x->request;
    if (r->has_body && x->reply)
        return refuse(x);
    if (r->has_body)
        guard_enter(x->listener->guard, x->guarded, r->is_body_stored ? GUARD_BODY : GUARD_SHORT_BODY);
    return MHD_YES;
}

/* The head has arrived. */
static enum MHD_Result begin(struct exchange *x, const char *method, const char *version) {
    struct listener *l = x->listener;
    const struct application *a = &l->application;
    struct request *r = &x->request;
    take_method(r, method);
    MHD_get_connection_values_n(x->connection, MHD_HEADER_KIND, take_field, r);
    struct address peer =
        address_of_socket(MHD_get_connection_info(x->connection, MHD_CONNECTION_INFO_CLIENT_ADDRESS)->client_addr);
    r->address = l->proxies ? address_of_request(r->fields, r->field_count, &peer, l->proxies) : peer;
    head_request_id(r);
    const char *length = request_field(r, "Content-Length");
    r->has_body = request_field(r, "Transfer-Encoding") || (length && strcmp(length, "0") != 0);
    r->content_length = length ? strtoll(length, NULL, 10) : r->has_body ? -1 : 0;
    struct response *refusal = head_check(r, version, a->server_names(a->user));
    if (!refusal && x->target_error.status != STATUS_OK)
        refusal = problem(r, 400, "%s", x->target_error.message);
    if (!refusal)
        refusal = a->find(a->user, r);
    if (!refusal && r->pace == PACE_AT_ONCE) {
        refusal = a->begin(a->user, r);
    } else if (!refusal) {
        x->is_beginning = true;
        if (exchange_give(x, r->is_body_stored ? l->slow : l->quick, exchange_begin_task))
            return MHD_YES; /* the pool owns x now */
        x->is_beginning = false;
        refusal = problem(r, 503, "the daemon is stopping");
    }
    x->reply = refusal;
    return refusal ? refuse(x) : accept_body(x);
}

static bool is_with_pool(struct exchange *x) {
    pthread_mutex_lock(&x->listener->mutex);
    bool is_so = x->place == EXCHANGE_WITH_POOL;
    pthread_mutex_unlock(&x->listener->mutex);
    return is_so;
}

/* Has a pool store the piece; no more of the body is read meanwhile. */
static enum MHD_Result give_piece(struct exchange *x) {
    guard_hold(x->listener->guard, x->guarded, true); /* the disk's delay does not count against the client */
    return exchange_give(x, x->listener->slow, exchange_piece_task) ? MHD_YES : MHD_NO;
}

static bool has_more_to_read(const struct exchange *x) {
    int fd = MHD_get_connection_info(x->connection, MHD_CONNECTION_INFO_CONNECTION_FD)->connect_fd, waiting = 0;
    return ioctl(fd, FIONREAD, &waiting) == 0 && waiting > 0;
}

/* Collects a body that goes to disk. A piece is stored when it is full, or when the socket has no more bytes, so that a
 * slow upload makes progress on disk. Of a chunked body the library offers the next chunk even while the connection is
 * suspended; it keeps what is not taken. */
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
        return MHD_YES; /* exchange_finish_task stores the last piece */
    return x->piece_bytes == PIECE_BYTES || !has_more_to_read(x) ? give_piece(x) : MHD_YES;
}

/* A part of the body has arrived. */
static enum MHD_Result take_body(struct exchange *x, const char *data, size_t *length) {
    struct listener *l = x->listener;
    if (!x->reply && x->request.is_body_stored)
        return collect(x, data, length);
    guard_body(l->guard, x->guarded, *length);
    if (!x->reply)
        x->reply = l->application.data(l->application.user, &x->request, data, *length);
    else if (x->has_replied_early)
        x->drained += *length;
    if (x->reply && !x->has_replied_early)
        reply_early(x);
    *length = 0;
    return x->drained > DRAIN_BYTES ? MHD_NO : MHD_YES;
}

/* The body has arrived. */
static enum MHD_Result finish(struct exchange *x) {
    const struct application *a = &x->listener->application;
    guard_enter(x->listener->guard, x->guarded, GUARD_REPLY);
    if (x->request.pace == PACE_AT_ONCE)
        x->reply = a->finish(a->user, &x->request);
    else if (exchange_give(x, exchange_pool(x), exchange_finish_task))
        return MHD_YES;
    else
        x->reply = problem(&x->request, 503, "the daemon is stopping");
    return reply_queue(x);
}

enum MHD_Result callbacks_on_request(void *user, struct MHD_Connection *connection, const char *url, const char *method,
                                     const char *version, const char *data, size_t *length, void **context) {
    (void)user, (void)connection, (void)url;
    struct exchange *x = *context;
    if (!x->has_begun) {
        x->has_begun = true;
        return begin(x, method, version);
    }
    if (x->is_beginning) {
        x->is_beginning = false;
        return accept_body(x);
    }
    if (*length > 0)
        return take_body(x, data, length);
    if (x->has_replied_early)
        return MHD_NO; /* the reply has been sent */
    return x->reply ? reply_queue(x) : finish(x);
}

void *callbacks_on_target(void *user, const char *target, struct MHD_Connection *connection) {
    struct exchange *x = mem_calloc(1, sizeof *x);
    x->listener = user;
    x->connection = connection;
    x->begun_sec = clock_sec();
    x->guarded = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_SOCKET_CONTEXT)->socket_context;
    target_parse(&x->request.target, target, &x->target_error);
    return x;
}

/* Requests that may change something are logged; GET and HEAD only at the debug level. */
static void log_request(const struct exchange *x, int status, bool is_whole) {
    static const char *const names[] = {"GET", "POST", "PATCH", "DELETE", "OPTIONS", "PUT", "other"};
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
    log_fields(r->method == METHOD_GET || r->is_throttled || r->is_routine ? LOG_DEBUG : LOG_INFO, fields,
               sizeof fields / sizeof *fields, "answered");
}

void callbacks_on_completed(void *user, struct MHD_Connection *connection, void **context,
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
    l->application.count(l->application.user, &x->request, status);
    log_request(x, status, code == MHD_REQUEST_TERMINATED_COMPLETED_OK);
    if (code == MHD_REQUEST_TERMINATED_TIMEOUT_REACHED)
        guard_discard_unsent(x->guarded);
    guard_enter(l->guard, x->guarded, GUARD_IDLE);
    bool has_files = x->request.upload || x->request.patch || (x->reply && (x->reply->fd >= 0 || x->reply->stream));
    x->task.run = exchange_end_task;
    if (has_files)
        pool_give(l->slow, &x->task);
    else
        exchange_end_task(&x->task);
}
