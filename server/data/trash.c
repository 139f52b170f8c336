/* trash.c -- see trash.h. Removed things are named trash/gone-TIME-NUMBER; other names in trash/ are temporary files
 * of other parts. */
#include "server/data/trash.h"

#include <errno.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "common/background.h"
#include "common/file.h"
#include "common/log.h"
#include "common/mem.h"
#include "server/data/layout.h"

#define PREFIX "gone-"

struct trash {
    const char *data_dir;
    void (*emptied)(void *user);
    void *user;
    long long started_ns;
    atomic_ullong number;
    struct background thread; /* its mutex guards what follows; not held during disk operations */
    bool has_work, is_working;
};

static void empty(struct trash *t) {
    struct error err;
    char **names;
    size_t count;
    char *folder = layout_trash(t->data_dir);
    if (file_list(folder, &names, &count, &err) != STATUS_OK)
        log_warning("what is to be removed cannot be found: %s", err.message);
    for (size_t i = 0; i < count && !atomic_load(&t->thread.stopping); i++) {
        char *path = file_join(folder, names[i]);
        if (strncmp(names[i], PREFIX, sizeof PREFIX - 1) == 0 && file_remove_tree(path, &err) != STATUS_OK)
            log_warning("%s is left until the next start: %s", path, err.message);
        mem_free(path);
    }
    file_free_names(names, count);
    mem_free(folder);
    if (t->emptied)
        t->emptied(t->user);
}

/* Removes temporary files of an earlier run. */
static enum status drop_temporary(const char *data_dir, struct error *err) {
    char **names;
    size_t count;
    char *folder = layout_trash(data_dir);
    enum status status = file_list(folder, &names, &count, err);
    for (size_t i = 0; i < count && status == STATUS_OK; i++) {
        char *path = file_join(folder, names[i]);
        if (strncmp(names[i], PREFIX, sizeof PREFIX - 1) != 0)
            status = file_remove_tree(path, err);
        mem_free(path);
    }
    file_free_names(names, count);
    mem_free(folder);
    return status;
}

static void *run(void *user) {
    struct trash *t = user;
    pthread_setname_np(pthread_self(), "trash");
    pthread_mutex_lock(&t->thread.mutex);
    while (!atomic_load(&t->thread.stopping)) {
        if (!t->has_work) {
            t->is_working = false;
            pthread_cond_broadcast(&t->thread.changed);
            pthread_cond_wait(&t->thread.changed, &t->thread.mutex);
            continue;
        }
        t->has_work = false;
        t->is_working = true;
        pthread_mutex_unlock(&t->thread.mutex);
        empty(t);
        pthread_mutex_lock(&t->thread.mutex);
    }
    pthread_mutex_unlock(&t->thread.mutex);
    return NULL;
}

enum status trash_new(struct trash **out, const char *data_dir, void (*emptied)(void *user), void *user,
                      struct error *err) {
    struct timespec now;
    *out = NULL;
    enum status status = drop_temporary(data_dir, err);
    if (status != STATUS_OK)
        return status;
    clock_gettime(CLOCK_REALTIME, &now);
    struct trash *t = mem_calloc(1, sizeof *t);
    t->data_dir = data_dir;
    t->emptied = emptied;
    t->user = user;
    t->started_ns = (long long)now.tv_sec * 1000000000 + now.tv_nsec;
    t->has_work = true;
    status = background_start(&t->thread, run, t, "removes files", err);
    if (status == STATUS_OK)
        *out = t;
    else
        mem_free(t);
    return status;
}

void trash_free(struct trash *t) {
    if (!t)
        return;
    background_stop(&t->thread);
    mem_free(t);
}

static void wake(struct trash *t) {
    pthread_mutex_lock(&t->thread.mutex);
    t->has_work = true;
    pthread_cond_broadcast(&t->thread.changed);
    pthread_mutex_unlock(&t->thread.mutex);
}

enum status trash_take(struct trash *t, const char *path, struct error *err) {
    char *from = file_join(t->data_dir, path);
    char *name = mem_printf(PREFIX "%lld-%llu", t->started_ns, atomic_fetch_add(&t->number, 1));
    char *to = layout_trash_file(t->data_dir, name);
    enum status status = STATUS_OK;
    bool is_moved = rename(from, to) == 0;
    if (!is_moved && (errno == ENOSPC || errno == EDQUOT))
        status = file_remove_tree(from, err);
    else if (!is_moved && errno != ENOENT)
        status = error_set_errno(err, errno, "cannot move %s away", from);
    wake(t);
    mem_free(from);
    mem_free(to);
    mem_free(name);
    return status;
}

bool trash_is_busy(struct trash *t) {
    pthread_mutex_lock(&t->thread.mutex);
    bool is_busy = t->has_work || t->is_working;
    pthread_mutex_unlock(&t->thread.mutex);
    return is_busy;
}

void trash_wait(struct trash *t) {
    pthread_mutex_lock(&t->thread.mutex);
    while (t->has_work || t->is_working)
        pthread_cond_wait(&t->thread.changed, &t->thread.mutex);
    pthread_mutex_unlock(&t->thread.mutex);
}
