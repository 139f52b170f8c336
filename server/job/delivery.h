/* delivery.h -- one message of the outbox on its way, by a worker process of its own.
 *
 *      empty ──start──> alive ──(process ends, or its time is up)──> ended ──settle──> empty
 *
 * settle can fail (the disk of state.db is full): the message stays ended and is settled again later,
 * so that its receiver is not called over and over. After an end of the daemon before that it is sent
 * again: its Webhook-Id tells the receiver so. */
#ifndef UNBAKE_JOB_DELIVERY_H
#define UNBAKE_JOB_DELIVERY_H

#include "server/job/scheduler_config.h"
#include "server/job/supervisor.h"
#include "server/store/store.h"

struct delivery {
    int64_t id; /* of the message; 0: empty */
    int64_t job_id;
    double kill_at_sec;
    struct worker worker;
    char *dir;
    char reason[256];          /* why it failed, by its own words */
    int64_t owner_id;          /* of the job */
    int status;                /* that was answered; 0: none */
    bool is_final;             /* it said that another try would end like this one */
    bool has_ended, delivered; /* its process; the message, then */
    bool complained;           /* that could not be entered, and the log says so */
};

/* Starts the message of that row. */
enum status delivery_start(struct delivery *d, const struct scheduler_config *config, const struct outbox_row *row,
                           struct error *err);
/* Notices its end, or brings it about, and enters it. True when it is empty again. */
bool delivery_listen(struct delivery *d, struct store *store);
/* Ends it; it is empty then. */
void delivery_stop(struct delivery *d, struct store *store);

#endif
