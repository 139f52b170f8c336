/* outbox.h -- messages to webhooks that are still to be sent. As for all of the store, see store.h. */
#ifndef UNBAKE_STORE_OUTBOX_H
#define UNBAKE_STORE_OUTBOX_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"

struct store; /* store.h */

/* A message to a webhook; every change of its job's state makes one. */
struct outbox_row {
    int64_t id, job_id;
    int64_t owner_id;          /* the job's owner; 0: nobody */
    char *url, *secret, *body; /* owned */
    int tries;
};
void outbox_row_release(struct outbox_row *row);
/* The first due message with id > after, except of the users skip[skip_count]; STATUS_NOT_FOUND when there is none. */
enum status store_outbox_next(struct store *store, int64_t after, const int64_t *skip, size_t skip_count,
                              struct outbox_row *row, struct error *err);
/* Time until the next message that is not yet due; infinite when there is none. */
enum status store_outbox_wait(struct store *store, double *seconds, struct error *err);
struct outbox_outcome {
    bool delivered;
    bool is_final;      /* another try would fail the same way */
    int status;         /* HTTP status; 0: none */
    const char *reason; /* why it was not delivered; NULL: it was */
};
/* Removes a delivered message, or postpones it: longer each time, and in the end gives up. The job shows the
 * outcome. */
enum status store_outbox_settle(struct store *store, int64_t id, const struct outbox_outcome *outcome, bool *gave_up,
                                struct error *err);
/* Makes the job's messages due now, with all their tries again; if there are none, queues one about its current
 * state. STATUS_CONFLICT: the job has no webhook. */
enum status store_webhook_again(struct store *store, int64_t job_id, struct error *err);

#endif
