/* examine.h -- what `unbaked doctor` finds out about a site without a job of its own: what takes one is try.h's. */
#ifndef UNBAKE_EXECUTOR_EXAMINE_H
#define UNBAKE_EXECUTOR_EXAMINE_H

#include <stdbool.h>

#include "server/executor/site.h"

/* Whether the site's programs are there and status answers, the url is reached, the program of the nodes, where it is
 * to be seen from here, is this one, the shared folder takes files, and its clock is this machine's. Calls `tell` with
 * each finding. */
void site_examine(const struct site *site, void (*tell)(void *user, bool is_good, const char *text), void *user);

#endif
