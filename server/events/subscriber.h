/* subscriber.h -- the body of an event stream, or of a reply that waits for a job to change.
 *
 * A subscriber reads events from the database in batches and holds one batch of text, so a slow reader costs neither
 * memory nor anybody else's time. Progress events that it was too slow for are gone from the database; where other
 * events are gone, it sends a `resync`. */
#ifndef UNBAKE_EVENTS_SUBSCRIBER_H
#define UNBAKE_EVENTS_SUBSCRIBER_H

#include <stdbool.h>
#include <stdint.h>

#include "common/json.h"
#include "server/events/hub.h"
#include "server/transport/message.h"

struct subscription {
    int64_t job_id;   /* 0: all that the caller may read */
    int64_t after;    /* the newest event that the client has */
    bool is_ahead;    /* the client has seen later ones, which this database lacks: it was restored from a backup */
    bool is_ndjson;   /* JSON lines; else Server-Sent Events */
    bool is_past;     /* ends after the events that are stored already */
    double wait_sec;  /* above 0: ends with the first events, or after this time */
    int64_t revision; /* not 0: the reply is no events but the job, sent once its revision differs from this one (-1:
                       * once it has ended), or after wait_sec */
    cJSON *(*view_job)(const struct job *job, const struct caller *who); /* the job as JSON; for `revision` */
    cJSON *snapshot; /* data of a first `state` event; taken; NULL: none */
};

/* Joins the hub. NULL, with *answer, where the limits do not allow one more stream. */
struct stream *subscriber_new(struct hub *hub, struct store *store, const struct caller *caller,
                              const struct subscription *what, const struct hub_limits *limits,
                              enum hub_answer *answer);

#endif
