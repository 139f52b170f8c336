/* events.c -- requests for events, and GET of a job that waits for a change. */
#include <stdio.h>

#include "common/protocol.h"
#include "server/events/subscriber.h"
#include "server/http/auth.h"
#include "server/http/handlers.h"
#include "server/http/limits.h"
#include "server/http/views.h"
#include "server/net/field.h"
#include "server/transport/problem.h"

#define WAIT_MAX_SEC 300 /* of ?wait= */

/* Fills *what from the query and the header fields. The stream starts after Last-Event-ID, else ?after=, else the
 * newest event; *is_resumed when the client named a start. An EventSource reconnects with its original URL and adds
 * Last-Event-ID, which is therefore the newer of the two. Returns NULL, or the refusal. */
static struct response *read_request(struct api *api, const struct request *r, struct subscription *what,
                                     bool *is_resumed) {
    const char *accept = request_field(r, "Accept"), *follow = target_query(&r->target, "follow");
    const char *query = target_query(&r->target, "after"), *wait = target_query(&r->target, "wait");
    const char *last_id = request_field(r, "Last-Event-ID");
    bool has_last_id = last_id && *last_id; /* an empty one is no id (HTML, 9.2.3) */
    const char *place = has_last_id ? last_id : query;
    int64_t follows = 1, wait_sec = 0, newest = 0;
    struct error err;
    if (follow && !field_number(follow, 0, 1, &follows))
        return problem(r, 400, "follow must be 0 or 1");
    if (wait && !field_number(wait, 1, WAIT_MAX_SEC, &wait_sec))
        return problem(r, 400, "wait must be a number of seconds from 1 to %d", WAIT_MAX_SEC);
    if (query && !field_number(query, 0, INT64_MAX, &what->after))
        return problem(r, 400, "after is not the id of an event");
    if (has_last_id && !field_number(last_id, 0, INT64_MAX, &what->after))
        return problem(r, 400, "Last-Event-ID is not the id of an event");
    if (!place && store_event_last(api->store, what->job_id, &what->after, &err) != STATUS_OK)
        return problem_from(r, &err);
    if (place && store_event_newest(api->store, &newest, &err) != STATUS_OK)
        return problem_from(r, &err);
    what->is_ahead = place && what->after > newest;
    if (what->is_ahead)
        what->after = newest;
    what->is_ndjson = accept && field_accepts(accept, MIME_NDJSON);
    what->is_past = !follows;
    what->wait_sec = (double)wait_sec;
    *is_resumed = place != NULL;
    return NULL;
}

/* The reply that is a stream, or its refusal. Takes what->snapshot. */
static struct response *stream_reply(struct api *api, const struct request *r, const char *type,
                                     const struct subscription *what) {
    const struct hub_limits limits = limits_of_streams(api, r);
    enum hub_answer answer;
    struct stream *stream = subscriber_new(api->hub, api->store, &r->caller, what, &limits, &answer);
    if (!stream)
        return limits_refuse_stream(api, r, answer);
    struct response *reply = response_new(200);
    response_field(reply, "Content-Type", "%s", type);
    response_field(reply, "Cache-Control", "no-store");
    response_field(reply, "X-Accel-Buffering", "no"); /* nginx: do not buffer */
    if (r->is_head)
        stream->close(stream);
    else
        reply->stream = stream;
    return reply;
}

static void note_any(void *user, const struct event_row *row) {
    (void)row;
    *(bool *)user = true;
}

struct response *events_get(struct api *api, struct request *r) {
    struct subscription what = {0};
    struct response *reply = NULL;
    struct error err;
    struct job job;
    bool is_resumed, has_more = false;
    if (!auth_job(api, r, ACCESS_READ, &job, &reply))
        return reply;
    what.job_id = job.id;
    reply = read_request(api, r, &what, &is_resumed);
    if (!reply && is_resumed && job_is_terminal(job.state)) {
        struct event_page page;
        if (store_event_page(api->store, NULL, job.id, what.after, 1, 1, note_any, &has_more, &page, &err) != STATUS_OK)
            reply = problem_from(r, &err);
        else if (!has_more && page.pruned_id <= what.after)
            reply = response_new(204); /* tells an EventSource to stop */
    }
    if (!reply) {
        what.snapshot = view_job(&job, &r->caller);
        reply = stream_reply(api, r, what.is_ndjson ? MIME_NDJSON : MIME_SSE, &what);
    }
    job_release(&job);
    return reply;
}

struct response *events_all(struct api *api, struct request *r) {
    struct subscription what = {0};
    bool is_resumed;
    struct response *reply = read_request(api, r, &what, &is_resumed);
    return reply ? reply : stream_reply(api, r, what.is_ndjson ? MIME_NDJSON : MIME_SSE, &what);
}

struct response *events_wait(struct api *api, struct request *r, const struct job *job) {
    const char *known = request_field(r, "If-None-Match");
    struct subscription what = {.job_id = job->id, .revision = -1, .view_job = view_job};
    char etag[48];
    int64_t wait_sec;
    snprintf(etag, sizeof etag, "\"rev-%lld\"", (long long)job->revision);
    if (!field_number(target_query(&r->target, "wait"), 1, WAIT_MAX_SEC, &wait_sec))
        return problem(r, 400, "wait must be a number of seconds from 1 to %d", WAIT_MAX_SEC);
    /* The change has happened already: an ordinary reply. */
    if (known ? !field_etag_listed(known, etag, true) : job_is_terminal(job->state))
        return NULL;
    if (known)
        what.revision = job->revision;
    what.wait_sec = (double)wait_sec;
    return stream_reply(api, r, MIME_JSON, &what);
}
