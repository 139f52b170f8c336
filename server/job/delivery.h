/* delivery.h -- one message of the outbox on its way, by a worker process of its own.
 *
 *      empty ──start──> alive ──(process ends, or its time is up)──> empty
 *
 * What became of it is entered when the process has ended; if that fails the message is sent
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
    char reason[256]; /* why it failed, by its own words */
};

/* Starts the message of that row. */
enum status delivery_start(struct delivery *d, const struct scheduler_config *config,
                           const struct outbox_row *row, struct error *err);
/* Notices its end, or brings it about. True when it is empty again. */
bool delivery_listen(struct delivery *d, struct store *store);
void delivery_kill(struct delivery *d);

#endif
