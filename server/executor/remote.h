/* remote.h -- the executor of a site (site.h): submits attempts to its scheduler, and follows them there.
 *
 *              submit                    claim                       end
 *      start ─────────> waiting in the ─────────> its node reports ─────────> ended
 *                       site's queue              under a lease
 *
 * 1. The attempt's row (store/remote.h) is on disk before its submission is sent. Whether a submission has come
 *    through, its reply does not decide alone: a failed one is found by name in the site's listing, and repeated, under
 *    another name and token, only after REMOTE_ABSENT_MAX good listings without it.
 * 2. A status command that fails, comes too late or says nothing that can be understood changes nothing.
 * 3. An attempt is lost when REMOTE_UNKNOWN_MAX listings in a row do not have it alive, and its node has been silent
 * for
 *    one and a half of its lease; both by a monotonic clock, which begins anew with the daemon. Then its row is closed,
 *    which shuts its node out, and only after its last writer has left it has ended.
 * 4. What the site has ended for its own reasons (pre-empted, out of time, a broken node), or started again, counts as
 *    pre-empted: the job goes on elsewhere and is not charged. But where its time was up before it had saved anything,
 *    the next one would fare no better: it waits for help (time_limit.h).
 * 5. A site's job that carries the name of an attempt that is over is cancelled when it is seen.
 * 6. A run outlives the daemon: freed before its end it goes on, and the next daemon resumes it.
 *
 * For the scheduler's thread; figures may be read by any. */
#ifndef UNBAKE_EXECUTOR_REMOTE_H
#define UNBAKE_EXECUTOR_REMOTE_H

#include <stdatomic.h>

#include "server/executor/command_queue.h"
#include "server/executor/site.h"
#include "server/job/run.h"
#include "server/store/store.h"

#define REMOTE_UNKNOWN_MAX 3 /* good listings in a row, as 3 says; by hand */
#define REMOTE_ABSENT_MAX 3  /* good listings in a row, as 1 says; by hand */
#define REMOTE_TRIES_MAX 3   /* failed submissions after which the attempt is given up and the job waits for help */

struct remote_figures {
    atomic_ullong waiting, running;                      /* attempts at this moment */
    atomic_ullong submissions, queries, cancels, faults; /* commands so far, and those of them that failed */
    atomic_ullong lost, preempted, refused;              /* attempts that ended so */
    atomic_ullong waited_ms;                             /* from submission to claim, of all that were claimed */
    atomic_ullong claimed;
};

struct remote; /* opaque */

struct remote_parts { /* all borrowed */
    const struct site *site;
    struct store *store;
    struct command_queue *commands;
    const char *data_dir;
    double (*now)(void *user); /* seconds of a monotonic clock */
    void *user;
};

struct remote *remote_new(const struct remote_parts *parts);
/* After its runs. */
void remote_free(struct remote *remote);
const struct executor *remote_executor(const struct remote *remote);
const struct remote_figures *remote_figures(const struct remote *remote);

#endif
