/* site_check.h -- what `unbaked doctor` finds out about a site without submitting a job; trial_job.h submits one. */
#ifndef UNBAKE_EXECUTOR_SITE_CHECK_H
#define UNBAKE_EXECUTOR_SITE_CHECK_H

#include <stdbool.h>

#include "server/executor/site.h"

/* Checks that the site's programs exist and its status command answers, that the url is reached, that the nodes'
 * program is of this version (where it is visible from here), that the shared folder can be written, and that its
 * clock agrees with this machine's. Calls `tell` with each finding. */
void site_check(const struct site *site, void (*tell)(void *user, bool is_good, const char *text), void *user);

#endif
