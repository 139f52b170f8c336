/* delivery.h -- one message of the outbox on its way, by a worker process of its own.
 *
 *      empty ──start──> alive ──(process ends, or its time is up)──> ended ──settle──> empty
 *
 * settle can fail (the disk of state.db is full): the message stays ended and is settled again later,
 * so that its receiver is not called over and over. After an end of the daemon before that it is sent
 * again: its Webhook-Id tells the receiver so. */
#ifndef UNBAKE_JOB_DELIVERY_H
#define UNBAKE_JOB_DELIVERY_H

#include "server/job/run.h"
#include "server/job/scheduler_config.h"
#include "server/store/store.h"

struct delivery {
    int64_t id; /* of the message; 0: empty */
    int64_t job_id;
    double kill_at_sec;
    struct run *run; /* owned */
    char *dir;
    char reason[256];          /* why it failed, as the process reports */
    int64_t owner_id;          /* of the job */
    int status;                /* that the receiver answered with; 0: none */
    bool is_final;             /* the process says that another try would end the same way */
    bool has_ended, delivered; /* the process has ended; the message was delivered */
    bool complained;           /* the log says that the outcome could not be entered */
};

/* Starts delivering that message. */
enum status delivery_start(struct delivery *d, const struct scheduler_config *config, const struct outbox_row *row,
                           struct error *err);
/* Reads from the process, ends it when its time is up, and enters the outcome. True when the slot is empty again. */
bool delivery_poll(struct delivery *d, struct store *store);
/* Ends the process and empties the slot. */
void delivery_stop(struct delivery *d, struct store *store);

#endif
