/* subscriber.c -- see subscriber.h. */
#include "server/events/subscriber.h"

#include <string.h>

#include "common/buf.h"
#include "common/clock.h"
#include "common/mem.h"
#include "server/events/event_text.h"
#include "server/events/hub.h"

#define BATCH_EVENTS 64                /* read from the database at once */
#define BATCH_BYTES ((size_t)64 << 10) /* of events' data; a single event may have more */
#define TEXT_BYTES ((size_t)1 << 20)   /* of a batch as text; far above what BATCH_BYTES can become */

struct subscriber {
    struct stream base;
    struct hub *hub;
    struct store *store;
    struct hub_member member;
    struct subscription what; /* its `after`: events up to here are in `text` or sent */
    struct caller caller;
    struct buf text; /* the batch */
    size_t text_read;
    bool has_ended;
};

/* What comes before any event of the database. */
static void start_text(struct subscriber *s) {
    struct subscription *what = &s->what;
    if (!what->is_ndjson && what->revision == 0)
        buf_puts(&s->text, what->snapshot ? "retry: 3000\n" : "retry: 3000\n\n");
    if (what->snapshot)
        event_text_add_snapshot(&s->text, what->is_ndjson, what->job_id, what->after, what->snapshot);
    what->snapshot = NULL;
    if (what->is_ahead)
        event_text_add_resync(&s->text, what->is_ndjson, what->after,
                              "the given event id is newer than any event here: "
                              "GET the current state");
}

static void add_row(void *user, const struct event_row *row) {
    struct subscriber *s = user;
    event_text_add_row(&s->text, s->what.is_ndjson, row);
}

/* Reads the next batch, or takes the one that another stream has just read. */
static enum status fetch_page(struct subscriber *s, struct event_page *page) {
    struct hub *hub = s->hub;
    struct hub_batch batch = {s->what.job_id, s->what.after, s->what.is_ndjson};
    if (hub_find_batch(hub, &batch, &s->caller, page, &s->text))
        return STATUS_OK;
    uint64_t version = hub_version(hub); /* before the events are read: a change meanwhile makes the batch stale */
    enum status status = store_event_page(s->store, &s->caller, s->what.job_id, s->what.after, BATCH_EVENTS,
                                          BATCH_BYTES, add_row, s, page, NULL);
    if (status == STATUS_OK && s->what.job_id)
        hub_share_batch(hub, &batch, version, page, &s->text);
    return status;
}

/* Fetches the next batch of events. Sets has_ended when the stream's last event is in it, and when the job is gone or
 * the caller may no longer read it. */
static void fetch_events(struct subscriber *s) {
    struct subscription *what = &s->what;
    struct event_page page;
    if (fetch_page(s, &page) != STATUS_OK) {
        s->has_ended = true; /* after a fault of the database the client reconnects */
        return;
    }
    if (page.pruned_id > what->after) {
        buf_clear(&s->text); /* the resync goes first; the batch is fetched again after it */
        event_text_add_resync(&s->text, what->is_ndjson, page.pruned_id,
                              "events up to this one are no longer kept: GET the current state");
        what->after = page.pruned_id;
        hub_mark_dirty(s->hub, &s->member);
        return;
    }
    what->after = page.last_id;
    if (page.is_full && what->wait_sec <= 0.0)
        hub_mark_dirty(s->hub, &s->member);
    else if (what->is_past || (what->job_id && job_is_terminal(page.state)) || (what->wait_sec > 0.0 && page.count > 0))
        s->has_ended = true;
}

/* The job itself, once it has changed as the client wants it to, or the wait is over. */
static void fetch_job(struct subscriber *s, bool is_over) {
    struct job job;
    if (store_job_get(s->store, s->what.job_id, &job, NULL) != STATUS_OK) {
        s->has_ended = true;
        return;
    }
    bool may_read = caller_access_job(&s->caller, &job) >= ACCESS_READ;
    bool has_changed = s->what.revision > 0 ? job.revision != s->what.revision : job_is_terminal(job.state);
    if (may_read && (has_changed || is_over)) {
        cJSON *view = s->what.view_job(&job, &s->caller);
        char *text = json_text(view);
        buf_puts(&s->text, text);
        mem_free(text);
        cJSON_Delete(view);
    }
    s->has_ended = !may_read || has_changed || is_over;
    job_release(&job);
}

/* Puts into `text` what there is to send now, if anything. */
static void refill(struct subscriber *s) {
    struct hub *hub = s->hub;
    /* Most streams are idle most of the time: between batches they keep no memory for text. */
    buf_release(&s->text);
    buf_init(&s->text, TEXT_BYTES);
    s->text_read = 0;
    bool is_dirty = hub_take_dirty(hub, &s->member), is_due = hub_take_due(hub, &s->member);
    bool is_over = is_due && s->member.end_sec > 0.0 && clock_sec() >= s->member.end_sec;
    if (s->has_ended)
        return;
    if (s->what.revision != 0 && (is_dirty || is_over))
        fetch_job(s, is_over);
    else if (is_dirty)
        fetch_events(s);
    if (is_over)
        s->has_ended = true;
    else if (s->text.length == 0 && is_due && s->what.revision == 0)
        event_text_add_keepalive(&s->text, s->what.is_ndjson);
}

static bool token_is_over(struct subscriber *s) {
    if (s->caller.expires_ms && clock_unix_ms() >= s->caller.expires_ms)
        return true;
    return hub_take_suspect(s->hub, &s->member) && s->caller.token_id &&
           !store_token_is_valid(s->store, s->caller.token_id);
}

static bool subscriber_fill(struct stream *base) {
    struct subscriber *s = (struct subscriber *)base;
    hub_listen(s->hub, &s->member); /* `wake` is set by the first fill */
    if (token_is_over(s))
        s->has_ended = true;
    else
        refill(s);
    return s->text.length > s->text_read || s->has_ended;
}

static ssize_t subscriber_read(struct stream *base, char *to, size_t size) {
    struct subscriber *s = (struct subscriber *)base;
    size_t count = s->text.length - s->text_read;
    if (count == 0)
        return s->has_ended ? -1 : 0;
    if (s->text.overflowed)
        return -1; /* no batch of ours is that long */
    count = count < size ? count : size;
    memcpy(to, s->text.data + s->text_read, count);
    s->text_read += count;
    hub_sent(s->hub, &s->member);
    return (ssize_t)count;
}

/* Frees a subscriber that is not, or no longer, in the hub. */
static void subscriber_free(struct subscriber *s) {
    buf_release(&s->text);
    cJSON_Delete(s->what.snapshot);
    mem_free(s);
}

static void subscriber_close(struct stream *base) {
    struct subscriber *s = (struct subscriber *)base;
    hub_leave(s->hub, &s->member);
    subscriber_free(s);
}

struct stream *subscriber_new(struct hub *hub, struct store *store, const struct caller *caller,
                              const struct subscription *what, const struct hub_limits *limits,
                              enum hub_answer *answer) {
    struct subscriber *s = mem_calloc(1, sizeof *s);
    s->base.read = subscriber_read;
    s->base.fill = subscriber_fill;
    s->base.close = subscriber_close;
    s->base.must_say = what->revision != 0;
    s->hub = hub;
    s->store = store;
    s->caller = *caller;
    s->what = *what;
    s->member = (struct hub_member){
        .stream = &s->base,
        .job_id = what->job_id,
        .user_id = caller->user_id,
        .end_sec = what->wait_sec > 0.0 ? clock_sec() + what->wait_sec : 0.0,
        .is_dirty = true,
        .is_suspect = true, /* the token may have been revoked since the request's head was checked */
        .sent_sec = clock_sec(),
    };
    buf_init(&s->text, TEXT_BYTES);
    start_text(s);
    *answer = hub_join(hub, &s->member, limits); /* last: from here on others change the member */
    if (*answer == HUB_JOINED)
        return &s->base;
    subscriber_free(s);
    return NULL;
}
