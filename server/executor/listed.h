/* listed.h -- what a site says of its jobs: the output of its status command, a job a line. */
#ifndef UNBAKE_EXECUTOR_LISTED_H
#define UNBAKE_EXECUTOR_LISTED_H

#include <stdbool.h>
#include <stddef.h>

#include "server/executor/site.h"

struct listed {
    char name[64], id[64], reason[128];
    enum site_state state;
};

struct listed_jobs {
    struct listed *job; /* [count], by name; of one name the liveliest first; owned */
    size_t count;
};

#define NAME_PREFIX "unbake-" /* of our jobs at the site */
/* Takes the lines that match site->status_line and whose name begins with NAME_PREFIX. False where the text is garbage:
 * there are lines, and none matches. */
bool listed_read(struct listed_jobs *listing, const struct site *site, const char *text);
void listed_release(struct listed_jobs *listing);
/* NULL: the site does not know it. */
const struct listed *listed_find(const struct listed_jobs *listing, const char *name);

#endif
