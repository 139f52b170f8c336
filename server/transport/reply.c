/* reply.c -- see reply.h. */
#include "server/transport/reply.h"

#include <sys/socket.h>

#include "common/buf.h"
#include "server/net/tls.h"
#include "server/transport/file_stream.h"

#define EVENT_BLOCK_BYTES ((size_t)32 << 10) /* that the library asks an event stream for at once */
#define FILE_BLOCK_BYTES ((size_t)64 << 10)  /* and a file */
#define EARLY_BYTES 16384                    /* of a reply that is sent before the body has ended */

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
        exchange_give_back(x);
    } else if (x->is_woken) { /* the event may have come after fill had looked */
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

void reply_end_streams(struct listener *l) {
    while (l->waiting) {
        struct exchange *x = l->waiting;
        unlink_waiting(x);
        l->working_count++;
        exchange_give_back(x);
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
    if (got == 0 && exchange_give(x, stream->is_sized ? x->listener->slow : x->listener->quick, fill_task))
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
        x->is_open_stream = true;
        pthread_mutex_unlock(&x->listener->mutex);
    }
    if (reply->stream && reply->stream->is_sized)
        return MHD_create_response_from_callback(reply->length, FILE_BLOCK_BYTES, read_stream, x, NULL);
    if (reply->stream)
        return MHD_create_response_from_callback(MHD_SIZE_UNKNOWN, EVENT_BLOCK_BYTES, read_stream, x, NULL);
    /* The exchange owns the text and outlives the library's response. */
    return MHD_create_response_from_buffer(reply->length, reply->text ? reply->text : "", MHD_RESPMEM_PERSISTENT);
}

/* false if a field could not be added: the reply must then not be sent. Fields without a value are left out. */
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

enum MHD_Result reply_queue(struct exchange *x) {
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

/* libmicrohttpd cannot reply before the end of the body: it would close the connection. So the reply is written to the
 * socket directly. The caller drains the body for a while: closing at once would reset the connection before the client
 * has read the reply. */
void reply_early(struct exchange *x) {
    bool is_tls = x->listener->tls != NULL;
    const union MHD_ConnectionInfo *info = MHD_get_connection_info(
        x->connection, is_tls ? MHD_CONNECTION_INFO_GNUTLS_SESSION : MHD_CONNECTION_INFO_CONNECTION_FD);
    struct response *reply = x->reply;
    struct buf text;
    buf_init(&text, EARLY_BYTES);
    buf_printf(&text, "HTTP/1.1 %d Refused\r\nConnection: close\r\nX-Request-Id: %s\r\nContent-Length: %llu\r\n",
               reply->status, x->request.id, (unsigned long long)reply->length);
    for (size_t i = 0; i < reply->field_count; i++)
        buf_printf(&text, "%s: %s\r\n", reply->fields[i].name, reply->fields[i].value);
    buf_puts(&text, "\r\n");
    buf_append(&text, reply->text, reply->length);
    /* A few hundred bytes fit into the socket's buffer unless the client does not read. */
    if (info && is_tls)
        tls_send(info->tls_session, text.data, text.length);
    else if (info)
        (void)!send(info->connect_fd, text.data, text.length, MSG_DONTWAIT | MSG_NOSIGNAL);
    buf_release(&text);
    x->has_replied_early = true;
}
