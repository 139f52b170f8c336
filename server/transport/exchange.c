/* exchange.c -- see exchange.h. */
#include "server/transport/exchange.h"

#include "common/mem.h"

bool exchange_give(struct exchange *x, struct pool *pool, void (*run)(struct task *task)) {
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

void exchange_give_back(struct exchange *x) {
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
    exchange_give_back(x);
    pthread_mutex_unlock(&l->mutex);
}

void exchange_finish_task(struct task *task) {
    struct exchange *x = (struct exchange *)task;
    const struct application *a = &x->listener->application;
    if (x->piece_bytes > 0)
        x->reply = a->data(a->user, &x->request, x->piece, x->piece_bytes);
    x->piece_bytes = 0;
    if (!x->reply)
        x->reply = a->finish(a->user, &x->request);
    done(x);
}

struct pool *exchange_pool(const struct exchange *x) {
    return x->request.pace == PACE_SLOW ? x->listener->slow : x->listener->quick;
}

void exchange_begin_task(struct task *task) {
    struct exchange *x = (struct exchange *)task;
    const struct application *a = &x->listener->application;
    x->reply = a->begin(a->user, &x->request);
    if (x->reply || x->request.has_body) {
        done(x);
    } else if (exchange_pool(x) == x->listener->slow) {
        x->task.run = exchange_finish_task;
        pool_give(x->listener->slow, &x->task);
    } else {
        exchange_finish_task(task);
    }
}

void exchange_piece_task(struct task *task) {
    struct exchange *x = (struct exchange *)task;
    const struct application *a = &x->listener->application;
    x->reply = a->data(a->user, &x->request, x->piece, x->piece_bytes);
    x->piece_bytes = 0;
    guard_hold(x->listener->guard, x->guarded, false);
    done(x);
}

void exchange_end_task(struct task *task) {
    struct exchange *x = (struct exchange *)task;
    struct listener *l = x->listener;
    bool was_stream = x->is_open_stream;
    if (x->request.patch && x->piece_bytes > 0)
        response_free(l->application.data(l->application.user, &x->request, x->piece, x->piece_bytes));
    response_free(x->reply); /* closes the stream: after this nobody wakes x */
    l->application.drop(&x->request);
    request_release(&x->request);
    mem_free(x->piece);
    mem_free(x);
    pthread_mutex_lock(&l->mutex);
    l->stream_count -= was_stream;
    pthread_cond_broadcast(&l->changed);
    pthread_mutex_unlock(&l->mutex);
}
