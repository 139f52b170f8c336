/* trial_job.h -- sends a job of some seconds through a site's scheduler and prints how long each step takes: what
 * `unbaked executor test` does. */
#ifndef UNBAKE_EXECUTOR_TRIAL_JOB_H
#define UNBAKE_EXECUTOR_TRIAL_JOB_H

#include <stdbool.h>

#include "server/executor/site.h"

#define TRIAL_JOB_SEC 5      /* duration of the job: some status commands long */
#define CLOCKS_APART_SEC 2.0 /* by which clocks may differ: leases do not depend on them, times of files and logs do */

struct node_probe {
    const char *file; /* NULL: it writes nothing */
    const char *url;  /* of the daemon; NULL: it is not asked */
    const char *ca;   /* file of certificates to trust; NULL: the system's */
};
/* On the node: waits for TRIAL_JOB_SEC and writes host, version, time and what is wrong on the way to the daemon to the
 * file, as JSON. Without a file the latter is the returned status. */
enum status probe_run(const struct node_probe *probe, struct error *err);
/* Whether a daemon answers there, be it with a refusal. */
enum status probe_url(const char *url, const char *ca, struct error *err);

/* Prints each step to stdout; false where one failed. Waits for wait_sec at most for the job to begin. */
bool trial_job_run(const struct site *site, double wait_sec);

#endif
