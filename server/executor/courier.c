/* courier.c -- see courier.h. */
#include "server/executor/courier.h"

#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>

#include "common/buf.h"
#include "common/mem.h"
#include "server/executor/command.h"
#include "server/executor/template.h"

struct list {
    struct errand **item; /* [count], oldest first; owned */
    size_t count;
};

struct thread {
    struct courier courier; /* first */
    pthread_t thread;
    pthread_mutex_t mutex; /* around all of the following */
    pthread_cond_t called;
    struct list asked, done;
    atomic_bool stopping;
    double deadline_sec;
    void (*wake)(void *user);
    void *user;
};

void errand_free(struct errand *errand) {
    if (!errand)
        return;
    words_free(errand->argv);
    mem_free(errand->input);
    mem_free(errand->output);
    mem_free(errand);
}

static void put(struct list *list, struct errand *errand) {
    list->item = mem_realloc_array(list->item, list->count + 1, sizeof *list->item);
    list->item[list->count++] = errand;
}

static struct errand *take(struct list *list) {
    if (list->count == 0)
        return NULL;
    struct errand *first = list->item[0];
    list->count--;
    for (size_t i = 0; i < list->count; i++)
        list->item[i] = list->item[i + 1];
    return first;
}

static void run(struct errand *errand, double deadline_sec, const atomic_bool *stop) {
    struct buf output;
    buf_init(&output, COMMAND_OUTPUT_MAX);
    errand->status = command_run(errand->argv, errand->input, deadline_sec, stop, &output, &errand->err);
    errand->output = mem_strdup(buf_text(&output));
    buf_release(&output);
}

static void *work(void *user) {
    struct thread *t = user;
    pthread_mutex_lock(&t->mutex);
    while (!t->stopping) {
        struct errand *next = take(&t->asked);
        if (!next) {
            pthread_cond_wait(&t->called, &t->mutex);
            continue;
        }
        pthread_mutex_unlock(&t->mutex);
        run(next, t->deadline_sec, &t->stopping);
        pthread_mutex_lock(&t->mutex);
        put(&t->done, next);
        pthread_mutex_unlock(&t->mutex);
        t->wake(t->user);
        pthread_mutex_lock(&t->mutex);
    }
    pthread_mutex_unlock(&t->mutex);
    return NULL;
}

static void send(struct courier *courier, struct errand *errand) {
    struct thread *t = (struct thread *)(void *)courier;
    pthread_mutex_lock(&t->mutex);
    put(&t->asked, errand);
    pthread_cond_signal(&t->called);
    pthread_mutex_unlock(&t->mutex);
}

static struct errand *receive(struct courier *courier) {
    struct thread *t = (struct thread *)(void *)courier;
    pthread_mutex_lock(&t->mutex);
    struct errand *first = take(&t->done);
    pthread_mutex_unlock(&t->mutex);
    return first;
}

struct courier *courier_thread_new(double deadline_sec, void (*wake)(void *user), void *user, struct error *err) {
    struct thread *t = mem_calloc(1, sizeof *t);
    *t = (struct thread){
        .courier = {.send = send, .receive = receive}, .deadline_sec = deadline_sec, .wake = wake, .user = user};
    pthread_mutex_init(&t->mutex, NULL);
    pthread_cond_init(&t->called, NULL);
    sigset_t all, before; /* signals are for the main thread */
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    int number = pthread_create(&t->thread, NULL, work, t);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    if (number == 0)
        return &t->courier;
    error_set_errno(err, number, "cannot start a thread");
    mem_free(t);
    return NULL;
}

void courier_thread_free(struct courier *courier) {
    struct thread *t = (struct thread *)(void *)courier;
    if (!t)
        return;
    pthread_mutex_lock(&t->mutex);
    t->stopping = true;
    pthread_cond_signal(&t->called);
    pthread_mutex_unlock(&t->mutex);
    pthread_join(t->thread, NULL);
    for (struct errand *e; (e = take(&t->asked)) != NULL;)
        errand_free(e);
    for (struct errand *e; (e = take(&t->done)) != NULL;)
        errand_free(e);
    mem_free(t->asked.item);
    mem_free(t->done.item);
    pthread_mutex_destroy(&t->mutex);
    pthread_cond_destroy(&t->called);
    mem_free(t);
}
