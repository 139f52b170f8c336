/* job_status.h -- the state of a site's jobs: parses the output of its status command, a job a line. */
#ifndef UNBAKE_EXECUTOR_JOB_STATUS_H
#define UNBAKE_EXECUTOR_JOB_STATUS_H

#include <stdbool.h>
#include <stddef.h>

#include "server/executor/site.h"

struct job_status {
    char name[64], id[64], reason[128]; /* the reason for which it waits, or "" */
    enum site_state state;
};

struct job_status_list {
    struct job_status *job; /* [count], by name; of one name the liveliest first; owned */
    size_t count;
};

#define NAME_PREFIX "unbake-" /* of our jobs at the site */
/* Takes the lines that match site->status_line and whose name begins with NAME_PREFIX. False where the text is garbage:
 * there are lines, and none matches. */
bool job_status_parse(struct job_status_list *listing, const struct site *site, const char *text);
void job_status_release(struct job_status_list *listing);
/* NULL: the site does not know it. */
const struct job_status *job_status_find(const struct job_status_list *listing, const char *name);

#endif
