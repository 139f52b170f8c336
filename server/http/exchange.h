/* exchange.h -- one request on its way, between libmicrohttpd's threads and those that may wait. For listener.c.
 *
 *              library: on_request                    pools: quick, slow
 *   head   ──> head_check, routes_find ──suspend──>   routes_begin ─────┐ no body
 *   body   ──> routes_data (in memory)                                  │
 *          ──> a piece is full         ──suspend──>   routes_data       │
 *   end    ──>                         ──suspend──>   routes_finish  <──┘
 *   reply  <── queued                  <──resume───
 *   stream <── stream->read            ──suspend──>   stream->fill, or later, when it is woken
 *   over   ──> on_completed            ────────────>  files are closed and removed
 *
 * 1. Whoever has the exchange (enum exchange_place) is the only one to touch it, but for what the mutex guards.
 * 2. Its connection is suspended while it is elsewhere than with the library. */
#ifndef UNBAKE_HTTP_EXCHANGE_H
#define UNBAKE_HTTP_EXCHANGE_H

#include <microhttpd.h>
#include <pthread.h>

#include "server/http/api.h"
#include "server/http/message.h"
#include "server/net/acceptor.h"
#include "server/net/guard.h"
#include "server/net/pool.h"

enum exchange_place {
    EXCHANGE_WITH_LIBRARY,
    EXCHANGE_WITH_POOL,
    EXCHANGE_WAITING /* a stream that has nothing to say */
};

struct exchange {
    struct task task; /* of a pool; the first member */
    struct listener *listener;
    struct MHD_Connection *connection;
    struct guarded *guarded;
    struct request request;
    struct error target_error;    /* what is wrong with the request target, if status is set */
    struct response *reply;       /* kept until the library has sent it */
    bool has_begun, is_beginning; /* a pool has begun with it, and the library asks again */
    bool has_replied_early;
    char *piece; /* [PIECE_BYTES] of a body that is stored; NULL before its first bytes */
    size_t piece_bytes;
    uint64_t taken, drained; /* bytes of the body */
    double begun_sec;        /* the request line was there */
    /* Under listener->mutex: */
    enum exchange_place place;
    bool is_woken;                    /* while it was not waiting */
    bool reply_pending;               /* a pool's reply, a short one, is on its way */
    struct exchange *next, *previous; /* among the waiting streams */
};

struct listener {
    struct api *api;
    struct MHD_Daemon *daemon;
    struct guard *guard;
    struct tls *tls;           /* NULL: plain HTTP */
    struct acceptor *acceptor; /* has the listening socket */
    struct connection_counts *connection_counts;
    uint16_t port;
    struct pool *quick, *slow; /* see route.h */
    pthread_mutex_t mutex;     /* guards what follows; nobody waits for anything else while he has it */
    pthread_cond_t changed;
    bool is_closing;
    struct exchange *waiting;   /* streams, doubly linked */
    size_t working_count;       /* exchanges with a pool */
    size_t stream_count;        /* event streams that are open */
    size_t pending_reply_count; /* exchanges that are owed a reply */
};

/* The library's callbacks: a request's line is there; its head, body or end; it is over. */
void *exchange_on_target(void *listener, const char *target, struct MHD_Connection *connection);
enum MHD_Result exchange_on_request(void *user, struct MHD_Connection *connection, const char *url, const char *method,
                                    const char *version, const char *data, size_t *length, void **context);
void exchange_on_completed(void *user, struct MHD_Connection *connection, void **context,
                           enum MHD_RequestTerminationCode code);
/* Wakes all streams that wait; from then on (is_closing) they end. The mutex is held. */
void exchange_wake_all(struct listener *l);

#endif
