/* events.c -- see events.h. */
#include "server/http/events.h"

#include <pthread.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "common/clock.h"
#include "common/mem.h"
#include "common/protocol.h"
#include "server/http/auth.h"
#include "server/http/field.h"
#include "server/http/guard.h"
#include "server/http/handlers.h"
#include "server/http/problem.h"
#include "server/http/views.h"

#define BATCH_EVENTS 64
#define BATCH_BYTES ((size_t)8 << 20)

struct hub {
    pthread_mutex_t mutex; /* guards the list and its members' shared part */
    struct subscriber *first;
    size_t count;
    double keepalive_sec;
};

struct subscriber {
    struct stream base;
    struct api *api;
    int64_t job_id;
    struct caller caller;
    bool is_ndjson;
    bool is_past;         /* only what is stored by now: ?follow=0 */
    int64_t sent_id;      /* events up to here were rendered */
    struct buf text;      /* rendered, not yet read */
    size_t text_read;
    bool has_ended;
    bool is_listed;       /* in the hub, from the first read on: wake is set by then */
    /* Shared, under hub->mutex: */
    struct subscriber *next, *previous;
    bool is_dirty;        /* the database may hold more */
    bool is_due;          /* for a keep-alive */
    bool is_suspect;      /* its token may have been revoked */
    double last_sec;      /* something was last handed over */
};

struct hub *hub_new(double keepalive_sec) {
    struct hub *hub = mem_calloc(1, sizeof *hub);
    pthread_mutex_init(&hub->mutex, NULL);
    hub->keepalive_sec = keepalive_sec;
    return hub;
}

void hub_free(struct hub *hub) {
    pthread_mutex_destroy(&hub->mutex);
    mem_free(hub);
}

size_t hub_count(struct hub *hub) {
    pthread_mutex_lock(&hub->mutex);
    size_t count = hub->count;
    pthread_mutex_unlock(&hub->mutex);
    return count;
}

void hub_changed(void *user, int64_t job_id) {
    struct hub *hub = user;
    pthread_mutex_lock(&hub->mutex);
    for (struct subscriber *s = hub->first; s; s = s->next) {
        if (s->job_id != job_id || s->is_dirty)
            continue;
        s->is_dirty = true;
        s->base.wake(s->base.waker);
    }
    pthread_mutex_unlock(&hub->mutex);
}

void hub_tick(struct hub *hub, double now_sec) {
    pthread_mutex_lock(&hub->mutex);
    for (struct subscriber *s = hub->first; s; s = s->next) {
        if (s->is_due || now_sec - s->last_sec < hub->keepalive_sec)
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

/* One event; takes data, an object, which gets `at` and `attempt` where it lacks them. */
static void render(struct subscriber *s, int64_t id, int64_t at_ms, int attempt, const char *type,
                   cJSON *data) {
    char at[VIEW_TIME_SIZE];
    view_time(at_ms, at);
    if (!cJSON_GetObjectItemCaseSensitive(data, "at"))
        json_add_string(data, "at", at);
    if (!cJSON_GetObjectItemCaseSensitive(data, "attempt"))
        json_add_int(data, "attempt", attempt);
    char *text = json_text(data);
    if (s->is_ndjson)
        buf_printf(&s->text, "{\"id\":%lld,\"event\":\"%s\",\"data\":%s}\n", (long long)id, type, text);
    else
        buf_printf(&s->text, "id: %lld\nevent: %s\ndata: %s\n\n", (long long)id, type, text);
    mem_free(text);
    cJSON_Delete(data);
}

struct batch {
    struct subscriber *s;
    size_t count;
};

static void render_row(void *user, int64_t id, int64_t at_ms, int attempt, const char *type,
                       const char *data) {
    struct batch *b = user;
    cJSON *object = cJSON_Parse(data);
    render(b->s, id, at_ms, attempt, type, object ? object : cJSON_CreateObject());
    b->s->sent_id = id;
    b->count++;
}

static void render_snapshot(struct subscriber *s, const struct job *job) {
    cJSON *data = view_job(job);
    json_add_bool(data, "snapshot", true);
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    if (!s->is_ndjson)
        buf_puts(&s->text, "retry: 3000\n");
    render(s, s->sent_id, (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000, job->attempt, EVENT_STATE,
           data);
}

/* Renders what the database has after sent_id; sets has_ended after the last event of a job that
 * is in a terminal state or that is not to be followed, and when the job is gone. */
static void fetch(struct subscriber *s) {
    struct batch batch = {s, 0};
    struct store *store = s->api->store;
    struct job job;
    /* The state is asked for before the events: what happens in between is then not missed. */
    if (store_job_get(store, s->job_id, &job, NULL) != STATUS_OK) {
        s->has_ended = true;
        return;
    }
    bool is_terminal = job_is_terminal(job.state);
    bool may_read = caller_access_job(&s->caller, &job) >= ACCESS_READ;
    job_release(&job);
    if (!may_read) { /* it is no longer shared */
        s->has_ended = true;
        return;
    }
    if (store_event_list(store, s->job_id, s->sent_id, BATCH_EVENTS, render_row, &batch, NULL) != STATUS_OK)
        s->has_ended = true; /* the client comes back and asks again */
    if (batch.count == BATCH_EVENTS) {
        pthread_mutex_lock(&s->api->hub->mutex);
        s->is_dirty = true;
        pthread_mutex_unlock(&s->api->hub->mutex);
    } else if (is_terminal || s->is_past) {
        s->has_ended = true;
    }
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

static ssize_t subscriber_read(struct stream *base, char *to, size_t size) {
    struct subscriber *s = (struct subscriber *)base;
    struct hub *hub = s->api->hub;
    if (!s->is_listed)
        enlist(s);
    if (is_revoked(s))
        return -1;
    if (s->text_read == s->text.length) {
        buf_clear(&s->text);
        s->text_read = 0;
        pthread_mutex_lock(&hub->mutex);
        bool is_dirty = s->is_dirty, is_due = s->is_due;
        s->is_dirty = s->is_due = false;
        if (is_due)
            s->last_sec = clock_sec();
        pthread_mutex_unlock(&hub->mutex);
        if (is_dirty && !s->has_ended)
            fetch(s);
        if (s->text.length == 0 && s->has_ended)
            return -1;
        if (s->text.length == 0 && is_due)
            buf_puts(&s->text, s->is_ndjson ? "\n" : ": keepalive\n\n");
        if (s->text.length == 0)
            return 0;
        if (s->text.overflowed)
            return -1; /* a single batch of megabytes: nothing of ours */
    }
    size_t count = s->text.length - s->text_read;
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
    mem_free(s);
}

static struct stream *subscribe(struct api *api, const struct caller *caller, const struct job *job,
                                int64_t after, bool is_ndjson, bool is_past) {
    struct subscriber *s = mem_calloc(1, sizeof *s);
    s->base.read = subscriber_read;
    s->base.close = subscriber_close;
    s->api = api;
    s->job_id = job->id;
    s->caller = *caller;
    s->is_ndjson = is_ndjson;
    s->is_past = is_past;
    s->sent_id = after;
    s->is_dirty = true;
    s->is_suspect = true; /* revoked between the check of the head and the first read? */
    s->last_sec = clock_sec();
    buf_init(&s->text, BATCH_BYTES);
    render_snapshot(s, job);
    return &s->base;
}

/* --- the handler ------------------------------------------------------------------------- */

static void note_any(void *user, int64_t id, int64_t at_ms, int attempt, const char *type,
                     const char *data) {
    (void)id, (void)at_ms, (void)attempt, (void)type, (void)data;
    *(bool *)user = true;
}

/* Where the stream begins: ?after=, Last-Event-ID, or the newest event. Sets *is_resumed when
 * the client named a place. */
static enum status start_id(struct api *api, const struct request *r, int64_t job_id, int64_t *after,
                            bool *is_resumed, struct error *err) {
    const char *query = target_query(&r->target, "after");
    const char *last = request_field(r, "Last-Event-ID");
    const char *text = query ? query : last;
    *is_resumed = text != NULL;
    if (!text)
        return store_event_last(api->store, job_id, after, err);
    if (!field_number(text, 0, INT64_MAX, after))
        return error_set(err, STATUS_INPUT, "%s is not the id of an event", query ? "after" : "Last-Event-ID");
    return STATUS_OK;
}

struct response *events_get(struct api *api, struct request *r) {
    const char *accept = request_field(r, "Accept"), *follow = target_query(&r->target, "follow");
    int64_t follows = 1;
    bool is_ndjson = accept && field_accepts(accept, MIME_NDJSON), is_resumed, has_more = false;
    int64_t after = 0;
    struct error err;
    struct job job;
    struct response *reply = NULL;
    if (follow && !field_number(follow, 0, 1, &follows))
        return problem(r, 400, "follow must be 0 or 1");
    if (!auth_job(api, r, ACCESS_READ, &job, &reply))
        return reply;
    enum status status = start_id(api, r, job.id, &after, &is_resumed, &err);
    if (status != STATUS_OK) {
        job_release(&job);
        return status == STATUS_INPUT ? problem(r, 400, "%s", err.message) : problem_from(r, &err);
    }
    if (is_resumed && job_is_terminal(job.state)) {
        status = store_event_list(api->store, job.id, after, 1, note_any, &has_more, &err);
        if (status != STATUS_OK)
            reply = problem_from(r, &err);
        else if (!has_more)
            reply = response_new(204);
    }
    if (!reply && hub_count(api->hub) >= api->config.max_streams)
        reply = problem(r, 503, "there are %zu event streams already", api->config.max_streams);
    if (!reply) {
        reply = response_new(200);
        response_field(reply, "Content-Type", "%s", is_ndjson ? MIME_NDJSON : MIME_SSE);
        response_field(reply, "Cache-Control", "no-store");
        response_field(reply, "X-Accel-Buffering", "no"); /* nginx: pass it on at once */
        if (!r->is_head)
            reply->stream = subscribe(api, &r->caller, &job, after, is_ndjson, !follows);
    }
    job_release(&job);
    return reply;
}
