/* events.h -- a job's events as they happen: Server-Sent Events or JSON lines.
 *
 * 1. The database is the queue: a stream holds the id it has sent up to and one batch of text, so
 *    a slow reader costs neither memory nor anybody else's time, and what it lags behind it
 *    reads from the database (where an overtaken progress event is no longer).
 * 2. hub_changed only marks and wakes; the text is made on the stream's own thread.
 * 3. Lock order: hub, then listener, then libmicrohttpd. The store is never called with any. */
#ifndef UNBAKE_HTTP_EVENTS_H
#define UNBAKE_HTTP_EVENTS_H

#include <stddef.h>
#include <stdint.h>

struct hub; /* the open streams; opaque; thread-safe */

struct hub *hub_new(double keepalive_sec);
void hub_free(struct hub *hub); /* all streams must be closed */

void hub_changed(void *hub, int64_t job_id); /* for store_on_change */
void hub_tick(struct hub *hub, double now_sec); /* about once a second: keep-alives */
/* A token was revoked: the streams that were opened with it end. */
void hub_recheck(struct hub *hub);
size_t hub_count(struct hub *hub);

#endif
