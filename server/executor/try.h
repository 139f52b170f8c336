/* try.h -- a job of some seconds through a site's scheduler, each step with what it took. */
#ifndef UNBAKE_EXECUTOR_TRY_H
#define UNBAKE_EXECUTOR_TRY_H

#include <stdbool.h>

#include "server/executor/site.h"

#define TRY_JOB_SEC 5 /* that the job takes */

/* On the node: waits for TRY_JOB_SEC and writes `file` (NULL: nothing): its host, version and time, as JSON. */
enum status probe_run(const char *file, struct error *err);

/* Prints each step to stdout; false where one failed. Waits for wait_sec at most for the job to begin. */
bool try_site(const struct site *site, double wait_sec);

#endif
