/* event_text.h -- events as text: Server-Sent Events (HTML, section 9.2), or JSON lines. */
#ifndef UNBAKE_EVENTS_EVENT_TEXT_H
#define UNBAKE_EVENTS_EVENT_TEXT_H

#include <stdbool.h>

#include "common/buf.h"
#include "common/json.h"
#include "server/store/store.h"

/* Appends an event of the store, whose data is JSON text. */
void event_text_add_row(struct buf *text, bool is_ndjson, const struct event_row *row);
/* Appends the current state of a job, its view; takes it. The event's id is the one that the client already has, so
 * that a client that keeps the last id neither misses nor repeats an event. */
void event_text_add_snapshot(struct buf *text, bool is_ndjson, int64_t job_id, int64_t id, cJSON *view);
/* Appends a `resync`: the client lacks events up to id and must fetch the current state itself. */
void event_text_add_resync(struct buf *text, bool is_ndjson, int64_t id, const char *reason);
/* What keeps an idle connection open. */
void event_text_add_keepalive(struct buf *text, bool is_ndjson);

#endif
