/* hub.h -- what happens, as it happens: the events of a job or of all jobs, as Server-Sent Events
 * or JSON lines, and the replies that wait for something to happen.
 *
 * 1. The database is the queue: a stream holds the id it has sent up to and one batch of text, so
 *    a slow reader costs neither memory nor anybody else's time, and what it lags behind it
 *    reads from the database (where an overtaken progress event is no longer). Where what it has
 *    not read is gone altogether it gets a `resync`.
 * 2. hub_changed only marks and wakes; the text is made by the stream's fill, on a thread that may wait.
 * 3. Lock order: hub, then listener, then libmicrohttpd. The store is never called with any. */
#ifndef UNBAKE_HTTP_HUB_H
#define UNBAKE_HTTP_HUB_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "server/http/message.h"

struct api;
struct hub; /* the open streams; opaque; thread-safe */

struct hub *hub_new(double keepalive_sec);
void hub_free(struct hub *hub); /* all streams must be closed */

void hub_changed(void *hub, int64_t job_id);    /* for store_on_change */
void hub_tick(struct hub *hub, double now_sec); /* about once a second: keep-alives, ends of waits */
/* A token was revoked: the streams that were opened with it end. */
void hub_recheck(struct hub *hub);
size_t hub_count(struct hub *hub);
size_t hub_count_of(struct hub *hub, int64_t user_id); /* the streams of one user */

struct subscription {
    int64_t job_id; /* 0: all that the caller may read */
    int64_t after;  /* the newest event that the client has */
    bool is_ahead;  /* it has seen later ones, which this database does not know: it was put back */
    bool is_ndjson;
    bool is_past;     /* ends with what is stored by now */
    double wait_sec;  /* above 0: ends with the first events, or when so much time has passed */
    int64_t revision; /* not 0: no events, but the job itself, once its revision is another one or,
                          * for -1, once it has ended; or when wait_sec have passed */
    cJSON *snapshot;  /* data of a first `state` event; taken; NULL: none */
};
struct stream *hub_subscribe(struct api *api, const struct caller *caller, const struct subscription *what);

#endif
