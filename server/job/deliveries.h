/* deliveries.h -- the messages of the outbox that are on their way, several at a time (delivery.h), of one user at most
 * two: a receiver that hangs delays no other user's messages. */
#ifndef UNBAKE_JOB_DELIVERIES_H
#define UNBAKE_JOB_DELIVERIES_H

#include <poll.h>

#include "server/job/delivery.h"

#define DELIVERIES_AT_ONCE 8 /* messages on their way */

struct deliveries {
    struct delivery slot[DELIVERIES_AT_ONCE];
    double due_at; /* when the next message is due, as clock_sec */
};

/* Listens to those that are under way and starts those that are due while there are free slots. */
enum status deliveries_run(struct deliveries *d, const struct scheduler_config *config, struct store *store,
                           struct error *err);
/* What to wait for until deliveries_run is to be called again: at most DELIVERIES_AT_ONCE * RUN_FDS descriptors, whose
 * number is returned; and the time until then. */
size_t deliveries_poll(const struct deliveries *d, struct pollfd *fds, double *sleep_sec);
/* Ends them; they are repeated after the next start. */
void deliveries_stop(struct deliveries *d, struct store *store);

#endif
