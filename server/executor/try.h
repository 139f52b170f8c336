/* try.h -- a job of some seconds through a site's scheduler, each step with what it took. */
#ifndef UNBAKE_EXECUTOR_TRY_H
#define UNBAKE_EXECUTOR_TRY_H

#include <stdbool.h>

#include "server/executor/site.h"

#define TRY_JOB_SEC 5        /* that the job takes */
#define CLOCKS_APART_SEC 2.0 /* by which clocks may differ: leases do not depend on them, times of files and logs do */

struct node_probe {
    const char *file; /* NULL: it writes nothing */
    const char *url;  /* of the daemon; NULL: it is not asked */
    const char *ca;   /* file of certificates to trust; NULL: the system's */
};
/* On the node: waits for TRY_JOB_SEC and writes to the file its host, version and time, and what is wrong on its way to
 * the daemon, as JSON. Without a file the latter is its status. */
enum status probe_run(const struct node_probe *probe, struct error *err);
/* Whether a daemon answers there, be it with a refusal. */
enum status probe_url(const char *url, const char *ca, struct error *err);

/* Prints each step to stdout; false where one failed. Waits for wait_sec at most for the job to begin. */
bool try_site(const struct site *site, double wait_sec);

#endif
