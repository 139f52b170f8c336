/* exchange.h -- one request and its reply, handed between libmicrohttpd's threads, which must not block, and the pools,
 * whose threads may. For listener.c, callbacks.c and reply.c. find, begin, data and finish are the application's.
 *
 *              library: on_request              pools: quick, slow
 *   head   ──> head_check, find ──suspend──>    begin ─────────┐ no body
 *   body   ──> data (in memory)                                │
 *          ──> a piece is full  ──suspend──>    data           │
 *   end    ──>                  ──suspend──>    finish      <──┘
 *   reply  <── queued           <──resume───
 *   stream <── stream->read     ──suspend──>    stream->fill, now or when woken
 *   over   ──> on_completed     ────────────>   files are closed and removed
 *
 * 1. Only the owner of an exchange (enum exchange_place) touches it, except for what the mutex guards.
 * 2. Its connection is suspended unless the library owns it. */
#ifndef UNBAKE_TRANSPORT_EXCHANGE_H
#define UNBAKE_TRANSPORT_EXCHANGE_H

#include <microhttpd.h>
#include <pthread.h>

#include "server/net/acceptor.h"
#include "server/net/guard.h"
#include "server/net/pool.h"
#include "server/transport/application.h"
#include "server/transport/message.h"

enum exchange_place {
    EXCHANGE_WITH_LIBRARY,
    EXCHANGE_WITH_POOL,
    EXCHANGE_WAITING /* a stream with nothing to send; in listener->waiting */
};

struct exchange {
    struct task task; /* for a pool; the first member: tasks are cast to exchanges */
    struct listener *listener;
    struct MHD_Connection *connection;
    struct guarded *guarded;
    struct request request;
    struct error target_error; /* what is wrong with the request target, if status is set */
    struct response *reply;    /* kept until the library has sent it */
    bool has_begun;            /* the head was seen */
    bool is_beginning;         /* a pool works on the head; the library will call again */
    bool has_replied_early;
    bool is_open_stream; /* counted in listener->stream_count */
    char *piece;         /* [PIECE_BYTES] of a body that is stored; NULL before its first bytes */
    size_t piece_bytes;
    uint64_t taken, drained; /* bytes of the body */
    double begun_sec;        /* when the request line arrived; clock_sec */
    /* Under listener->mutex: */
    enum exchange_place place;
    bool is_woken;                    /* a wake-up came while it was not waiting */
    bool reply_pending;               /* a pool has made a short reply; it is not sent yet */
    struct exchange *next, *previous; /* among the waiting streams */
};

struct listener {
    struct application application;
    const struct proxies *proxies; /* borrowed; NULL: none */
    struct MHD_Daemon *daemon;
    struct guard *guard;
    struct tls *tls;           /* NULL: plain HTTP */
    struct acceptor *acceptor; /* owns the listening socket */
    struct connection_counts *connection_counts;
    uint16_t port;
    struct pool *quick, *slow; /* see listener.h */
    pthread_mutex_t mutex;     /* guards what follows; nothing blocks while it is held */
    pthread_cond_t changed;
    bool is_closing;
    struct exchange *waiting;   /* streams, doubly linked */
    size_t working_count;       /* exchanges that a pool owns */
    size_t stream_count;        /* open event streams */
    size_t pending_reply_count; /* exchanges with reply_pending */
};

/* Suspends the connection and queues the exchange in the pool, which calls run(&x->task). false, and nothing is done,
 * when the daemon is closing. */
bool exchange_give(struct exchange *x, struct pool *pool, void (*run)(struct task *task));
/* Resumes the connection: from here on only the library may touch x. The mutex is held. */
void exchange_give_back(struct exchange *x);
/* The pool that works on the request's route. */
struct pool *exchange_pool(const struct exchange *x);

/* What a pool runs: the application's begin, data, finish. */
void exchange_begin_task(struct task *task);
void exchange_piece_task(struct task *task);
void exchange_finish_task(struct task *task);
/* Frees the exchange, its reply and its files. A resumable upload keeps what has arrived. */
void exchange_end_task(struct task *task);

#endif
