/* courier.c -- see courier.h. */
#include "server/executor/courier.h"

#include "common/background.h"
#include "common/buf.h"
#include "common/mem.h"
#include "server/executor/command.h"
#include "server/executor/template.h"

struct list {
    struct errand **item; /* [count], oldest first; owned */
    size_t count;
};

struct thread {
    struct courier courier;       /* first */
    struct background background; /* its mutex is around the lists */
    struct list asked, done;
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
    pthread_mutex_lock(&t->background.mutex);
    while (!atomic_load(&t->background.stopping)) {
        struct errand *next = take(&t->asked);
        if (!next) {
            pthread_cond_wait(&t->background.changed, &t->background.mutex);
            continue;
        }
        pthread_mutex_unlock(&t->background.mutex);
        run(next, t->deadline_sec, &t->background.stopping);
        pthread_mutex_lock(&t->background.mutex);
        put(&t->done, next);
        pthread_mutex_unlock(&t->background.mutex);
        t->wake(t->user);
        pthread_mutex_lock(&t->background.mutex);
    }
    pthread_mutex_unlock(&t->background.mutex);
    return NULL;
}

static void send(struct courier *courier, struct errand *errand) {
    struct thread *t = (struct thread *)(void *)courier;
    pthread_mutex_lock(&t->background.mutex);
    put(&t->asked, errand);
    pthread_cond_signal(&t->background.changed);
    pthread_mutex_unlock(&t->background.mutex);
}

static struct errand *receive(struct courier *courier) {
    struct thread *t = (struct thread *)(void *)courier;
    pthread_mutex_lock(&t->background.mutex);
    struct errand *first = take(&t->done);
    pthread_mutex_unlock(&t->background.mutex);
    return first;
}

struct courier *courier_thread_new(double deadline_sec, void (*wake)(void *user), void *user, struct error *err) {
    struct thread *t = mem_calloc(1, sizeof *t);
    *t = (struct thread){
        .courier = {.send = send, .receive = receive}, .deadline_sec = deadline_sec, .wake = wake, .user = user};
    if (background_start(&t->background, work, t, "runs a site's commands", err) == STATUS_OK)
        return &t->courier;
    mem_free(t);
    return NULL;
}

void courier_thread_free(struct courier *courier) {
    struct thread *t = (struct thread *)(void *)courier;
    if (!t)
        return;
    background_stop(&t->background);
    for (struct errand *e; (e = take(&t->asked)) != NULL;)
        errand_free(e);
    for (struct errand *e; (e = take(&t->done)) != NULL;)
        errand_free(e);
    mem_free(t->asked.item);
    mem_free(t->done.item);
    mem_free(t);
}
