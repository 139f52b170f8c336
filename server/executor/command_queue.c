/* command_queue.c -- see command_queue.h. */
#include "server/executor/command_queue.h"

#include "common/background.h"
#include "common/buf.h"
#include "common/mem.h"
#include "server/executor/command.h"
#include "server/executor/template.h"

struct list {
    struct site_command **item; /* [count], oldest first; owned */
    size_t count;
};

struct thread {
    struct command_queue commands; /* first */
    struct background background;  /* its mutex is around the lists */
    struct list asked, done;
    double deadline_sec;
    void (*wake)(void *user);
    void *user;
};

void site_command_free(struct site_command *command) {
    if (!command)
        return;
    words_free(command->argv);
    mem_free(command->input);
    mem_free(command->output);
    mem_free(command);
}

static void put(struct list *list, struct site_command *command) {
    list->item = mem_realloc_array(list->item, list->count + 1, sizeof *list->item);
    list->item[list->count++] = command;
}

static struct site_command *take(struct list *list) {
    if (list->count == 0)
        return NULL;
    struct site_command *first = list->item[0];
    list->count--;
    for (size_t i = 0; i < list->count; i++)
        list->item[i] = list->item[i + 1];
    return first;
}

static void run(struct site_command *command, double deadline_sec, const atomic_bool *stop) {
    struct buf output;
    buf_init(&output, COMMAND_OUTPUT_MAX);
    command->status = command_run(command->argv, command->input, deadline_sec, stop, &output, &command->err);
    command->output = mem_strdup(buf_text(&output));
    buf_release(&output);
}

static void *work(void *user) {
    struct thread *t = user;
    pthread_mutex_lock(&t->background.mutex);
    while (!atomic_load(&t->background.stopping)) {
        struct site_command *next = take(&t->asked);
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

static void add(struct command_queue *commands, struct site_command *command) {
    struct thread *t = (struct thread *)(void *)commands;
    pthread_mutex_lock(&t->background.mutex);
    put(&t->asked, command);
    pthread_cond_signal(&t->background.changed);
    pthread_mutex_unlock(&t->background.mutex);
}

static struct site_command *next_done(struct command_queue *commands) {
    struct thread *t = (struct thread *)(void *)commands;
    pthread_mutex_lock(&t->background.mutex);
    struct site_command *first = take(&t->done);
    pthread_mutex_unlock(&t->background.mutex);
    return first;
}

struct command_queue *command_queue_new(double deadline_sec, void (*wake)(void *user), void *user, struct error *err) {
    struct thread *t = mem_calloc(1, sizeof *t);
    *t = (struct thread){
        .commands = {.add = add, .next_done = next_done}, .deadline_sec = deadline_sec, .wake = wake, .user = user};
    if (background_start(&t->background, work, t, "runs a site's commands", err) == STATUS_OK)
        return &t->commands;
    mem_free(t);
    return NULL;
}

void command_queue_free(struct command_queue *commands) {
    struct thread *t = (struct thread *)(void *)commands;
    if (!t)
        return;
    background_stop(&t->background);
    for (struct site_command *e; (e = take(&t->asked)) != NULL;)
        site_command_free(e);
    for (struct site_command *e; (e = take(&t->done)) != NULL;)
        site_command_free(e);
    mem_free(t->asked.item);
    mem_free(t->done.item);
    mem_free(t);
}
