/* hub.c -- the open event streams, and the text that each of them sends; see hub.h. */
#include "server/http/hub.h"

#include <pthread.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "common/clock.h"
#include "common/mem.h"
#include "common/protocol.h"
#include "server/http/api.h"
#include "server/http/views.h"

#define BATCH_EVENTS 64
#define BATCH_BYTES ((size_t)64 << 10) /* of data; a single event may have more */
#define TEXT_BYTES ((size_t)1 << 20)

/* The part of a job's events that was rendered last: most streams of a job ask for the same one. */
struct rendered {
    uint64_t version; /* of the store, by the hub's count, when it was fetched */
    int64_t job_id;   /* 0: nothing yet */
    int64_t after, owner_id;
    bool is_shared, is_ndjson;
    struct event_page page;
    struct buf text;
};

struct hub {
    pthread_mutex_t mutex; /* guards all that follows, and the subscribers' shared part */
    struct subscriber *first;
    size_t count;
    double keepalive_sec;
    uint64_t version; /* grows with every change */
    struct rendered last;
};

struct subscriber {
    struct stream base;
    struct api *api;
    struct subscription what; /* its `after`: events up to here were rendered */
    struct caller caller;
    double end_sec;  /* of a wait, as clock_sec; 0: never */
    struct buf text; /* rendered, not yet read */
    size_t text_read;
    bool has_ended;
    bool is_listed; /* in the hub, from the first read on: wake is set by then */
    /* Shared, under hub->mutex: */
    struct subscriber *next, *previous;
    bool is_dirty;   /* the database may hold more */
    bool is_due;     /* for a keep-alive, or the end of its wait */
    bool is_suspect; /* its token may have been revoked */
    double last_sec; /* something was last handed over */
};

struct hub *hub_new(double keepalive_sec) {
    struct hub *hub = mem_calloc(1, sizeof *hub);
    pthread_mutex_init(&hub->mutex, NULL);
    hub->keepalive_sec = keepalive_sec;
    buf_init(&hub->last.text, TEXT_BYTES);
    return hub;
}

void hub_free(struct hub *hub) {
    buf_release(&hub->last.text);
    pthread_mutex_destroy(&hub->mutex);
    mem_free(hub);
}

size_t hub_count(struct hub *hub) {
    pthread_mutex_lock(&hub->mutex);
    size_t count = hub->count;
    pthread_mutex_unlock(&hub->mutex);
    return count;
}

size_t hub_count_of(struct hub *hub, int64_t user_id) {
    size_t count = 0;
    pthread_mutex_lock(&hub->mutex);
    for (const struct subscriber *s = hub->first; s; s = s->next)
        count += s->caller.user_id == user_id;
    pthread_mutex_unlock(&hub->mutex);
    return count;
}

void hub_changed(void *user, int64_t job_id) {
    struct hub *hub = user;
    pthread_mutex_lock(&hub->mutex);
    hub->version++;
    for (struct subscriber *s = hub->first; s; s = s->next) {
        if ((s->what.job_id && s->what.job_id != job_id) || !job_id || s->is_dirty)
            continue;
        s->is_dirty = true;
        s->base.wake(s->base.waker);
    }
    pthread_mutex_unlock(&hub->mutex);
}

void hub_tick(struct hub *hub, double now_sec) {
    pthread_mutex_lock(&hub->mutex);
    for (struct subscriber *s = hub->first; s; s = s->next) {
        bool is_over = s->end_sec > 0.0 && now_sec >= s->end_sec;
        if (s->is_due || (!is_over && now_sec - s->last_sec < hub->keepalive_sec))
            continue;
        s->is_due = true;
        s->base.wake(s->base.waker);
    }
    pthread_mutex_unlock(&hub->mutex);
}

void hub_recheck(struct hub *hub) {
    pthread_mutex_lock(&hub->mutex);
    for (struct subscriber *s = hub->first; s; s = s->next) {
        s->is_suspect = true;
        s->base.wake(s->base.waker);
    }
    pthread_mutex_unlock(&hub->mutex);
}

/* --- text -------------------------------------------------------------------------------- */

/* What only the daemon says of an event, whatever its data has. */
static void set(cJSON *data, const char *name, cJSON *value) {
    cJSON_DeleteItemFromObjectCaseSensitive(data, name);
    json_add(data, name, value);
}

/* One event; takes data, an object, which gets `at`, `job` and `attempt`. */
static void render(struct subscriber *s, const struct event_row *row, cJSON *data) {
    char at[VIEW_TIME_SIZE];
    view_time(row->at_ms, at);
    set(data, "at", json_new_string(at));
    if (row->job_id) {
        set(data, "job", cJSON_CreateNumber((double)row->job_id));
        set(data, "attempt", cJSON_CreateNumber(row->attempt));
    }
    char *text = json_text(data);
    if (s->what.is_ndjson)
        buf_printf(&s->text, "{\"id\":%lld,\"event\":\"%s\",\"data\":%s}\n", (long long)row->id, row->type, text);
    else
        buf_printf(&s->text, "id: %lld\nevent: %s\ndata: %s\n\n", (long long)row->id, row->type, text);
    mem_free(text);
    cJSON_Delete(data);
}

static void render_row(void *user, const struct event_row *row) {
    cJSON *object = cJSON_Parse(row->data);
    render(user, row, object ? object : cJSON_CreateObject());
}

static int64_t now_ms(void) {
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

/* The client does not know all up to this event: it must look for itself, and goes on from there. */
static void render_resync(struct subscriber *s, int64_t id, const char *reason) {
    cJSON *data = cJSON_CreateObject();
    json_add_string(data, "reason", reason);
    struct event_row row = {.id = id, .at_ms = now_ms(), .type = EVENT_RESYNC};
    render(s, &row, data);
    s->what.after = id;
}

/* Before anything else, with the id that the client has: keeping the last id it neither misses nor
 * repeats an event. */
static void render_start(struct subscriber *s) {
    if (!s->what.is_ndjson && s->what.revision == 0)
        buf_puts(&s->text, s->what.snapshot ? "retry: 3000\n" : "retry: 3000\n\n");
    if (s->what.snapshot) {
        const cJSON *attempt = cJSON_GetObjectItemCaseSensitive(s->what.snapshot, "attempt");
        struct event_row row = {.id = s->what.after,
                                .job_id = s->what.job_id,
                                .at_ms = now_ms(),
                                .type = EVENT_STATE,
                                .attempt = attempt->valueint};
        json_add_bool(s->what.snapshot, "snapshot", true);
        render(s, &row, s->what.snapshot);
        s->what.snapshot = NULL;
    }
    if (s->what.is_ahead)
        render_resync(s, s->what.after,
                      "no event has the id that was given, and this is the newest one: "
                      "GET shows the present state");
}

static void mark_dirty(struct subscriber *s) {
    pthread_mutex_lock(&s->api->hub->mutex);
    s->is_dirty = true;
    pthread_mutex_unlock(&s->api->hub->mutex);
}

/* Takes the next part of a job's events from what another stream rendered just now, where nothing has
 * changed since and this stream's caller may read it too; false where there is none. */
static bool take_rendered(struct subscriber *s, struct event_page *page) {
    struct hub *hub = s->api->hub;
    const struct rendered *last = &hub->last;
    pthread_mutex_lock(&hub->mutex);
    struct job access = {.owner_id = last->owner_id, .is_shared = last->is_shared};
    bool is_it = last->job_id && last->job_id == s->what.job_id && last->after == s->what.after &&
                 last->is_ndjson == s->what.is_ndjson && last->version == hub->version &&
                 caller_access_job(&s->caller, &access) >= ACCESS_READ;
    if (is_it) {
        *page = last->page;
        buf_puts(&s->text, buf_text(&last->text));
    }
    pthread_mutex_unlock(&hub->mutex);
    return is_it;
}

/* Leaves for others what this stream has just rendered, at that version of the store. */
static void leave_rendered(struct subscriber *s, const struct event_page *page, uint64_t version) {
    struct hub *hub = s->api->hub;
    pthread_mutex_lock(&hub->mutex);
    struct rendered *last = &hub->last;
    buf_clear(&last->text);
    if (buf_puts(&last->text, buf_text(&s->text))) {
        last->version = version;
        last->job_id = s->what.job_id;
        last->after = s->what.after;
        last->is_ndjson = s->what.is_ndjson;
        last->owner_id = page->owner_id;
        last->is_shared = page->is_shared;
        last->page = *page;
    } else {
        last->job_id = 0;
    }
    pthread_mutex_unlock(&hub->mutex);
}

/* Reads and renders the next part. */
static enum status fetch_page(struct subscriber *s, struct event_page *page) {
    struct hub *hub = s->api->hub;
    if (take_rendered(s, page))
        return STATUS_OK;
    /* Before the database is asked: what changes meanwhile makes the text out of date. */
    pthread_mutex_lock(&hub->mutex);
    uint64_t version = hub->version;
    pthread_mutex_unlock(&hub->mutex);
    enum status status = store_event_page(s->api->store, &s->caller, s->what.job_id, s->what.after, BATCH_EVENTS,
                                          BATCH_BYTES, render_row, s, page, NULL);
    if (status == STATUS_OK && s->what.job_id)
        leave_rendered(s, page, version);
    return status;
}

/* Renders what the database has after the last event; sets has_ended after the last one of a job that
 * is in a terminal state or that is not to be followed, and when the job is gone or not to be read
 * any more. */
static void fetch(struct subscriber *s) {
    struct subscription *what = &s->what;
    struct event_page page;
    if (fetch_page(s, &page) != STATUS_OK) {
        s->has_ended = true; /* where the database is at fault the client comes back and asks again */
        return;
    }
    if (page.pruned_id > what->after) {
        buf_clear(&s->text); /* the same events come again, after the news that some are missing */
        render_resync(s, page.pruned_id, "events up to this one are no longer kept: GET shows the present state");
        mark_dirty(s);
        return;
    }
    what->after = page.last_id;
    if (page.is_full && what->wait_sec <= 0.0)
        mark_dirty(s);
    else if (what->is_past || (what->job_id && job_is_terminal(page.state)) || (what->wait_sec > 0.0 && page.count > 0))
        s->has_ended = true;
}

/* The job itself, where what was waited for has come. */
static void fetch_job(struct subscriber *s, bool is_over) {
    struct job job;
    if (store_job_get(s->api->store, s->what.job_id, &job, NULL) != STATUS_OK) {
        s->has_ended = true;
        return;
    }
    bool may_read = caller_access_job(&s->caller, &job) >= ACCESS_READ;
    bool has_come = s->what.revision > 0 ? job.revision != s->what.revision : job_is_terminal(job.state);
    if (may_read && (has_come || is_over)) {
        cJSON *view = view_job(&job, &s->caller);
        char *text = json_text(view);
        buf_puts(&s->text, text);
        mem_free(text);
        cJSON_Delete(view);
    }
    s->has_ended = !may_read || has_come || is_over;
    job_release(&job);
}

static void enlist(struct subscriber *s) {
    struct hub *hub = s->api->hub;
    pthread_mutex_lock(&hub->mutex);
    s->next = hub->first;
    if (s->next)
        s->next->previous = s;
    hub->first = s;
    hub->count++;
    pthread_mutex_unlock(&hub->mutex);
    s->is_listed = true;
}

static void delist(struct subscriber *s) {
    struct hub *hub = s->api->hub;
    pthread_mutex_lock(&hub->mutex);
    if (s->next)
        s->next->previous = s->previous;
    if (s->previous)
        s->previous->next = s->next;
    else
        hub->first = s->next;
    hub->count--;
    pthread_mutex_unlock(&hub->mutex);
}

/* Whether the stream's token was revoked after the stream was opened. */
static bool is_revoked(struct subscriber *s) {
    pthread_mutex_lock(&s->api->hub->mutex);
    bool is_suspect = s->is_suspect;
    s->is_suspect = false;
    pthread_mutex_unlock(&s->api->hub->mutex);
    return is_suspect && s->caller.token_id && !store_token_is_valid(s->api->store, s->caller.token_id);
}

/* Renders what there is to say now, if anything. */
static void refill(struct subscriber *s) {
    struct hub *hub = s->api->hub;
    /* Between batches a stream keeps no memory for text: most of them are idle most of the time. */
    buf_release(&s->text);
    buf_init(&s->text, TEXT_BYTES);
    s->text_read = 0;
    pthread_mutex_lock(&hub->mutex);
    bool is_dirty = s->is_dirty, is_due = s->is_due;
    s->is_dirty = s->is_due = false;
    if (is_due)
        s->last_sec = clock_sec();
    pthread_mutex_unlock(&hub->mutex);
    bool is_over = is_due && s->end_sec > 0.0 && clock_sec() >= s->end_sec;
    if (s->has_ended)
        return;
    if (s->what.revision != 0 && (is_dirty || is_over))
        fetch_job(s, is_over);
    else if (is_dirty)
        fetch(s);
    if (is_over)
        s->has_ended = true;
    else if (s->text.length == 0 && is_due && s->what.revision == 0)
        buf_puts(&s->text, s->what.is_ndjson ? "\n" : ": keepalive\n\n");
}

static bool subscriber_fill(struct stream *base) {
    struct subscriber *s = (struct subscriber *)base;
    if (!s->is_listed)
        enlist(s);
    if (is_revoked(s))
        s->has_ended = true;
    else
        refill(s);
    return s->text.length > s->text_read || s->has_ended;
}

static ssize_t subscriber_read(struct stream *base, char *to, size_t size) {
    struct subscriber *s = (struct subscriber *)base;
    struct hub *hub = s->api->hub;
    size_t count = s->text.length - s->text_read;
    if (count == 0)
        return s->has_ended ? -1 : 0;
    if (s->text.overflowed)
        return -1; /* a single batch of a megabyte: nothing of ours */
    count = count < size ? count : size;
    memcpy(to, s->text.data + s->text_read, count);
    s->text_read += count;
    pthread_mutex_lock(&hub->mutex);
    s->last_sec = clock_sec();
    pthread_mutex_unlock(&hub->mutex);
    return (ssize_t)count;
}

static void subscriber_close(struct stream *base) {
    struct subscriber *s = (struct subscriber *)base;
    if (s->is_listed)
        delist(s);
    buf_release(&s->text);
    cJSON_Delete(s->what.snapshot);
    mem_free(s);
}

struct stream *hub_subscribe(struct api *api, const struct caller *caller, const struct subscription *what) {
    struct subscriber *s = mem_calloc(1, sizeof *s);
    s->base.read = subscriber_read;
    s->base.fill = subscriber_fill;
    s->base.close = subscriber_close;
    s->base.must_say = what->revision != 0;
    s->api = api;
    s->caller = *caller;
    s->what = *what;
    s->end_sec = what->wait_sec > 0.0 ? clock_sec() + what->wait_sec : 0.0;
    s->is_dirty = true;
    s->is_suspect = true; /* revoked between the check of the head and the first read? */
    s->last_sec = clock_sec();
    buf_init(&s->text, TEXT_BYTES);
    render_start(s);
    return &s->base;
}
