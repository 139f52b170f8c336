/* pool.c -- see pool.h. */
#include "server/net/pool.h"

#include <pthread.h>
#include <stdbool.h>

#include "common/mem.h"

struct pool {
    pthread_mutex_t mutex; /* guards the queue and `stopping`; never held while a task runs */
    pthread_cond_t changed;
    struct task *first, *last;
    bool stopping;
    size_t thread_count;
    pthread_t threads[];
};

static void *work(void *user) {
    struct pool *p = user;
    pthread_mutex_lock(&p->mutex);
    for (;;) {
        while (!p->first && !p->stopping)
            pthread_cond_wait(&p->changed, &p->mutex);
        struct task *task = p->first;
        if (!task)
            break;
        p->first = task->next;
        pthread_mutex_unlock(&p->mutex);
        task->next = NULL;
        task->run(task);
        pthread_mutex_lock(&p->mutex);
    }
    pthread_mutex_unlock(&p->mutex);
    return NULL;
}

enum status pool_new(struct pool **out, const char *name, size_t thread_count, struct error *err) {
    struct pool *p = mem_calloc(1, sizeof *p + thread_count * sizeof *p->threads);
    pthread_mutex_init(&p->mutex, NULL);
    pthread_cond_init(&p->changed, NULL);
    *out = NULL;
    for (; p->thread_count < thread_count; p->thread_count++) {
        int failed = pthread_create(&p->threads[p->thread_count], NULL, work, p);
        if (failed) {
            pool_free(p);
            return error_set_errno(err, failed, "cannot start a thread");
        }
        pthread_setname_np(p->threads[p->thread_count], name);
    }
    *out = p;
    return STATUS_OK;
}

void pool_give(struct pool *p, struct task *task) {
    pthread_mutex_lock(&p->mutex);
    task->next = NULL;
    if (p->first)
        p->last->next = task;
    else
        p->first = task;
    p->last = task;
    pthread_cond_signal(&p->changed);
    pthread_mutex_unlock(&p->mutex);
}

void pool_free(struct pool *p) {
    if (!p)
        return;
    pthread_mutex_lock(&p->mutex);
    p->stopping = true;
    pthread_cond_broadcast(&p->changed);
    pthread_mutex_unlock(&p->mutex);
    for (size_t i = 0; i < p->thread_count; i++)
        pthread_join(p->threads[i], NULL);
    pthread_cond_destroy(&p->changed);
    pthread_mutex_destroy(&p->mutex);
    mem_free(p);
}
