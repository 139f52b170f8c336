/* readiness.c -- see readiness.h. */
#include "server/http/readiness.h"

#include <stdbool.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "common/background.h"
#include "common/clock.h"
#include "common/file.h"
#include "common/mem.h"
#include "server/data/layout.h"

struct readiness {
    struct store *store;
    const char *data_dir;
    struct background thread; /* its mutex guards what follows; not held during the probe */
    bool is_wanted, is_asking;
    double asked_sec;       /* when the probe under way began */
    unsigned long answered; /* number of finished probes */
    struct error answer;    /* result of the last one; STATUS_OK: all is well */
    uint64_t free_bytes;
};

/* Writes a file and reads it back. */
static enum status probe_disk(const struct readiness *r, struct error *err) {
    static const char text[] = "can this be read back?\n";
    struct buf found;
    char *path = layout_trash_file(r->data_dir, "probe"); /* a leftover is removed at the next start */
    buf_init(&found, 4096);
    enum status status = file_replace(path, text, sizeof text - 1, err);
    if (status == STATUS_OK)
        status = file_read(path, &found, err);
    if (status == STATUS_OK && strcmp(buf_text(&found), text) != 0)
        status = error_set(err, STATUS_CORRUPT, "%s: what is read back differs", path);
    unlink(path);
    buf_release(&found);
    mem_free(path);
    return status;
}

static void *run(void *user) {
    struct readiness *r = user;
    pthread_setname_np(pthread_self(), "readiness");
    pthread_mutex_lock(&r->thread.mutex);
    while (!atomic_load(&r->thread.stopping)) {
        struct error err = {0};
        uint64_t room = 0;
        if (!r->is_wanted) {
            pthread_cond_wait(&r->thread.changed, &r->thread.mutex);
            continue;
        }
        r->is_wanted = false;
        r->is_asking = true;
        r->asked_sec = clock_sec();
        pthread_mutex_unlock(&r->thread.mutex);
        enum status status = store_probe(r->store, &err);
        if (status == STATUS_OK)
            status = probe_disk(r, &err);
        if (status == STATUS_OK)
            status = file_free_bytes(r->data_dir, &room, &err);
        pthread_mutex_lock(&r->thread.mutex);
        err.status = status;
        r->answer = err;
        r->free_bytes = room;
        r->answered++;
        r->is_asking = false;
        pthread_cond_broadcast(&r->thread.changed);
    }
    pthread_mutex_unlock(&r->thread.mutex);
    return NULL;
}

enum status readiness_new(struct readiness **out, struct store *store, const char *data_dir, struct error *err) {
    struct readiness *r = mem_calloc(1, sizeof *r);
    r->store = store;
    r->data_dir = data_dir;
    enum status status = background_start(&r->thread, run, r, "asks the disk", err);
    *out = status == STATUS_OK ? r : NULL;
    if (status != STATUS_OK)
        mem_free(r);
    return status;
}

void readiness_free(struct readiness *r) {
    if (!r)
        return;
    background_stop(&r->thread);
    mem_free(r);
}

enum status readiness_probe(struct readiness *r, uint64_t *free_bytes, struct error *err) {
    double until_sec = clock_sec() + READINESS_WAIT_SEC;
    pthread_mutex_lock(&r->thread.mutex);
    bool is_late = r->is_asking && clock_sec() - r->asked_sec >= READINESS_WAIT_SEC;
    unsigned long before = r->answered;
    if (!r->is_asking && !r->is_wanted) {
        r->is_wanted = true;
        pthread_cond_broadcast(&r->thread.changed);
    }
    while (!is_late && r->answered == before && !atomic_load(&r->thread.stopping))
        is_late = !background_wait_until(&r->thread, until_sec);
    enum status status = r->answer.status;
    if (is_late || r->answered == before)
        status = error_set(err, STATUS_UNAVAILABLE, "the disk of the data folder has not answered within %d s",
                           READINESS_WAIT_SEC);
    else if (status != STATUS_OK)
        *err = r->answer;
    *free_bytes = r->free_bytes;
    pthread_mutex_unlock(&r->thread.mutex);
    return status;
}
