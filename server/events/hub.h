/* hub.h -- the open event streams: admits them, counts them, wakes those that a change in the store concerns.
 *
 * 1. A stream counts from the decision to admit it until it is closed, in whatever way.
 * 2. The database is the queue. hub_changed only marks a stream and wakes it; the stream's fill, on a thread that may
 *    block, reads the events (subscriber.h).
 * 3. Lock order: hub, then listener, then libmicrohttpd. No store call is made while any of them is held.
 *
 * Thread-safe. */
#ifndef UNBAKE_EVENTS_HUB_H
#define UNBAKE_EVENTS_HUB_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/buf.h"
#include "server/store/store.h"
#include "server/transport/message.h"

struct hub;

/* One open stream. After hub_join the hub's mutex guards the second part. */
struct hub_member {
    struct stream *stream;
    int64_t job_id; /* 0: events of all jobs */
    int64_t user_id;
    double end_sec; /* when its wait ends, as clock_sec; 0: never */

    struct hub_member *next, *previous;
    bool is_listening; /* may be woken */
    bool is_dirty;     /* the database may have new events for it */
    bool is_due;       /* a keep-alive is due, or its wait has ended */
    bool is_suspect;   /* its token may have been revoked */
    double sent_sec;   /* when it last sent something, as clock_sec */
};

struct hub *hub_new(double keepalive_sec);
void hub_free(struct hub *hub); /* all streams must be closed */

void hub_changed(void *hub, int64_t job_id);    /* for store_on_change */
void hub_tick(struct hub *hub, double now_sec); /* about once a second: keep-alives, ends of waits */
/* A token was revoked: the streams that were opened with it end. */
void hub_recheck(struct hub *hub);
size_t hub_count(struct hub *hub);

/* How many streams there may be, and how many of the new one's user (0: no limit), it included. */
struct hub_limits {
    size_t of_all, of_user;
};
enum hub_answer { HUB_JOINED, HUB_FULL, HUB_USER_FULL };
/* Admits the stream if the limits allow one more. After HUB_JOINED it counts until hub_leave, whatever becomes of
 * it. */
enum hub_answer hub_join(struct hub *hub, struct hub_member *m, const struct hub_limits *limits);
/* From now on changes wake it; m->stream->wake is set. Marks made before are kept. */
void hub_listen(struct hub *hub, struct hub_member *m);
void hub_leave(struct hub *hub, struct hub_member *m);
void hub_mark_dirty(struct hub *hub, struct hub_member *m);
void hub_sent(struct hub *hub, struct hub_member *m); /* sets sent_sec */
/* Return a mark and clear it. A member that was due counts as one that has sent something. */
bool hub_take_dirty(struct hub *hub, struct hub_member *m);
bool hub_take_due(struct hub *hub, struct hub_member *m);
bool hub_take_suspect(struct hub *hub, struct hub_member *m);

/* One batch of a job's events as text. The latest is shared: most streams of a job ask for the same one. */
struct hub_batch {
    int64_t job_id; /* 0: no batch */
    int64_t after;  /* its events are newer than this one */
    bool is_ndjson;
};
/* Grows with every change of the store. */
uint64_t hub_version(struct hub *hub);
/* Appends the shared batch to text if it is this one, nothing has changed since, and `who` may read the job. */
bool hub_find_batch(struct hub *hub, const struct hub_batch *batch, const struct caller *who, struct event_page *page,
                    struct buf *text);
/* Shares a batch; version: before its events were read. */
void hub_share_batch(struct hub *hub, const struct hub_batch *batch, uint64_t version, const struct event_page *page,
                     const struct buf *text);

#endif
