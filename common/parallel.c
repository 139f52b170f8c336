/* parallel.c -- see parallel.h. Workers sleep on a condition variable between loops and take
 * indices from an atomic counter within one. */
#include "common/parallel.h"

#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdbool.h>

#include "common/mem.h"

struct parallel {
    int thread_count;
    pthread_t *thread; /* [thread_count - 1] */
    pthread_mutex_t mutex;
    pthread_cond_t begin; /* a new generation, or closing */
    pthread_cond_t done;  /* running reached 0 */
    unsigned long generation;
    int running; /* workers still inside the present loop */
    bool closing;
    int next_slot; /* slots given to workers at their start */
    atomic_size_t next_index;
    size_t count;
    void (*body)(void *user, size_t index, int thread);
    void *user;
};

static void run_indices(struct parallel *p, int slot) {
    for (;;) {
        size_t index = atomic_fetch_add_explicit(&p->next_index, 1, memory_order_relaxed);
        if (index >= p->count)
            return;
        p->body(p->user, index, slot);
    }
}

static void *worker_main(void *argument) {
    struct parallel *p = argument;
    unsigned long seen = 0;
    pthread_mutex_lock(&p->mutex);
    int slot = p->next_slot++;
    for (;;) {
        while (p->generation == seen && !p->closing)
            pthread_cond_wait(&p->begin, &p->mutex);
        if (p->closing)
            break;
        seen = p->generation;
        pthread_mutex_unlock(&p->mutex);
        run_indices(p, slot);
        pthread_mutex_lock(&p->mutex);
        if (--p->running == 0)
            pthread_cond_signal(&p->done);
    }
    pthread_mutex_unlock(&p->mutex);
    return NULL;
}

static int processor_count(void) {
    cpu_set_t set;
    if (sched_getaffinity(0, sizeof set, &set) != 0)
        return 1;
    int count = CPU_COUNT(&set);
    return count > 0 ? count : 1;
}

struct parallel *parallel_new(int thread_count) {
    if (thread_count <= 0)
        thread_count = processor_count();
    struct parallel *p = mem_calloc(1, sizeof *p);
    pthread_mutex_init(&p->mutex, NULL);
    pthread_cond_init(&p->begin, NULL);
    pthread_cond_init(&p->done, NULL);
    p->thread = mem_array((size_t)thread_count, sizeof *p->thread);
    p->next_slot = 1;
    p->thread_count = 1;
    /* Signals are the main thread's business. */
    sigset_t all, old;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &old);
    while (p->thread_count < thread_count) {
        /* Fewer threads than asked for change only the speed, never a result. */
        if (pthread_create(&p->thread[p->thread_count - 1], NULL, worker_main, p) != 0)
            break;
        p->thread_count++;
    }
    pthread_sigmask(SIG_SETMASK, &old, NULL);
    return p;
}

void parallel_free(struct parallel *p) {
    if (!p)
        return;
    pthread_mutex_lock(&p->mutex);
    p->closing = true;
    pthread_cond_broadcast(&p->begin);
    pthread_mutex_unlock(&p->mutex);
    for (int i = 0; i < p->thread_count - 1; i++)
        pthread_join(p->thread[i], NULL);
    pthread_cond_destroy(&p->done);
    pthread_cond_destroy(&p->begin);
    pthread_mutex_destroy(&p->mutex);
    mem_free(p->thread);
    mem_free(p);
}

int parallel_thread_count(const struct parallel *p) { return p->thread_count; }

void parallel_for(struct parallel *p, size_t count, void (*body)(void *user, size_t index, int thread), void *user) {
    p->count = count;
    p->body = body;
    p->user = user;
    atomic_store(&p->next_index, 0);
    if (p->thread_count > 1 && count > 1) {
        pthread_mutex_lock(&p->mutex);
        p->running = p->thread_count - 1;
        p->generation++;
        pthread_cond_broadcast(&p->begin);
        pthread_mutex_unlock(&p->mutex);
        run_indices(p, 0);
        pthread_mutex_lock(&p->mutex);
        while (p->running > 0)
            pthread_cond_wait(&p->done, &p->mutex);
        pthread_mutex_unlock(&p->mutex);
    } else {
        run_indices(p, 0);
    }
}
