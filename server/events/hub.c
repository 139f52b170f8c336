/* hub.c -- see hub.h. */
#include "server/events/hub.h"

#include <pthread.h>

#include "common/clock.h"
#include "common/mem.h"

#define BATCH_BYTES ((size_t)1 << 20) /* of text that is shared; longer batches are not */

struct hub {
    pthread_mutex_t mutex; /* guards what follows, and the members' second part */
    struct hub_member *first;
    size_t count;
    double keepalive_sec;
    uint64_t version; /* grows with every change */
    /* The shared batch: */
    struct hub_batch batch;
    uint64_t batch_version; /* `version` before its events were read */
    struct event_page page;
    struct buf text;
};

struct hub *hub_new(double keepalive_sec) {
    struct hub *hub = mem_calloc(1, sizeof *hub);
    pthread_mutex_init(&hub->mutex, NULL);
    hub->keepalive_sec = keepalive_sec;
    buf_init(&hub->text, BATCH_BYTES);
    return hub;
}

void hub_free(struct hub *hub) {
    buf_release(&hub->text);
    pthread_mutex_destroy(&hub->mutex);
    mem_free(hub);
}

size_t hub_count(struct hub *hub) {
    pthread_mutex_lock(&hub->mutex);
    size_t count = hub->count;
    pthread_mutex_unlock(&hub->mutex);
    return count;
}

/* --- waking ------------------------------------------------------------------------------ */

static void wake(struct hub_member *m) {
    if (m->is_listening)
        m->stream->wake(m->stream->waker);
}

void hub_changed(void *user, int64_t job_id) {
    struct hub *hub = user;
    pthread_mutex_lock(&hub->mutex);
    hub->version++;
    for (struct hub_member *m = hub->first; m; m = m->next) {
        if ((m->job_id && m->job_id != job_id) || !job_id || m->is_dirty)
            continue;
        m->is_dirty = true;
        wake(m);
    }
    pthread_mutex_unlock(&hub->mutex);
}

void hub_tick(struct hub *hub, double now_sec) {
    pthread_mutex_lock(&hub->mutex);
    for (struct hub_member *m = hub->first; m; m = m->next) {
        bool is_over = m->end_sec > 0.0 && now_sec >= m->end_sec;
        if (m->is_due || (!is_over && now_sec - m->sent_sec < hub->keepalive_sec))
            continue;
        m->is_due = true;
        wake(m);
    }
    pthread_mutex_unlock(&hub->mutex);
}

void hub_recheck(struct hub *hub) {
    pthread_mutex_lock(&hub->mutex);
    for (struct hub_member *m = hub->first; m; m = m->next) {
        m->is_suspect = true;
        wake(m);
    }
    pthread_mutex_unlock(&hub->mutex);
}

/* --- members ----------------------------------------------------------------------------- */

static size_t count_of(const struct hub *hub, int64_t user_id) {
    size_t count = 0;
    for (const struct hub_member *m = hub->first; m; m = m->next)
        count += m->user_id == user_id;
    return count;
}

enum hub_answer hub_join(struct hub *hub, struct hub_member *m, const struct hub_limits *limits) {
    enum hub_answer answer = HUB_JOINED;
    pthread_mutex_lock(&hub->mutex);
    if (hub->count >= limits->of_all) {
        answer = HUB_FULL;
    } else if (limits->of_user > 0 && count_of(hub, m->user_id) >= limits->of_user) {
        answer = HUB_USER_FULL;
    } else {
        m->next = hub->first;
        if (m->next)
            m->next->previous = m;
        hub->first = m;
        hub->count++;
    }
    pthread_mutex_unlock(&hub->mutex);
    return answer;
}

void hub_listen(struct hub *hub, struct hub_member *m) {
    pthread_mutex_lock(&hub->mutex);
    m->is_listening = true;
    pthread_mutex_unlock(&hub->mutex);
}

void hub_leave(struct hub *hub, struct hub_member *m) {
    pthread_mutex_lock(&hub->mutex);
    if (m->next)
        m->next->previous = m->previous;
    if (m->previous)
        m->previous->next = m->next;
    else
        hub->first = m->next;
    hub->count--;
    pthread_mutex_unlock(&hub->mutex);
}

void hub_mark_dirty(struct hub *hub, struct hub_member *m) {
    pthread_mutex_lock(&hub->mutex);
    m->is_dirty = true;
    pthread_mutex_unlock(&hub->mutex);
}

void hub_sent(struct hub *hub, struct hub_member *m) {
    pthread_mutex_lock(&hub->mutex);
    m->sent_sec = clock_sec();
    pthread_mutex_unlock(&hub->mutex);
}

static bool take(struct hub *hub, bool *mark) {
    pthread_mutex_lock(&hub->mutex);
    bool was_set = *mark;
    *mark = false;
    pthread_mutex_unlock(&hub->mutex);
    return was_set;
}

bool hub_take_dirty(struct hub *hub, struct hub_member *m) { return take(hub, &m->is_dirty); }

bool hub_take_suspect(struct hub *hub, struct hub_member *m) { return take(hub, &m->is_suspect); }

bool hub_take_due(struct hub *hub, struct hub_member *m) {
    pthread_mutex_lock(&hub->mutex);
    bool is_due = m->is_due;
    m->is_due = false;
    if (is_due)
        m->sent_sec = clock_sec();
    pthread_mutex_unlock(&hub->mutex);
    return is_due;
}

/* --- the shared batch -------------------------------------------------------------------- */

uint64_t hub_version(struct hub *hub) {
    pthread_mutex_lock(&hub->mutex);
    uint64_t version = hub->version;
    pthread_mutex_unlock(&hub->mutex);
    return version;
}

bool hub_find_batch(struct hub *hub, const struct hub_batch *batch, const struct caller *who, struct event_page *page,
                    struct buf *text) {
    const struct hub_batch *shared = &hub->batch;
    pthread_mutex_lock(&hub->mutex);
    struct job access = {.owner_id = hub->page.owner_id, .is_shared = hub->page.is_shared};
    bool found = shared->job_id && shared->job_id == batch->job_id && shared->after == batch->after &&
                 shared->is_ndjson == batch->is_ndjson && hub->batch_version == hub->version &&
                 caller_access_job(who, &access) >= ACCESS_READ;
    if (found) {
        *page = hub->page;
        buf_puts(text, buf_text(&hub->text));
    }
    pthread_mutex_unlock(&hub->mutex);
    return found;
}

void hub_share_batch(struct hub *hub, const struct hub_batch *batch, uint64_t version, const struct event_page *page,
                     const struct buf *text) {
    pthread_mutex_lock(&hub->mutex);
    buf_clear(&hub->text);
    hub->batch = buf_puts(&hub->text, buf_text(text)) ? *batch : (struct hub_batch){0};
    hub->batch_version = version;
    hub->page = *page;
    pthread_mutex_unlock(&hub->mutex);
}
