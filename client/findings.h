/* findings.h -- what the check of a scene has found, for people: table, fit, warnings, problems. */
#ifndef UNBAKE_CLIENT_FINDINGS_H
#define UNBAKE_CLIENT_FINDINGS_H

#include "client/client.h"

/* "yes", "doubtful" or "no"; "" where it is not known: not checked yet, rejected, or checked by an older server. */
const char *findings_fit(const cJSON *scene);

/* All of it, on stdout. */
void findings_print(struct client *c, const cJSON *scene);

/* Of a scene on which a job has failed: warnings and problems, on stdout. */
void findings_print_faults(struct client *c, const cJSON *scene);

/* What somebody who submits a job should know, on stderr: the reading, warnings, a fit in doubt, a remedy, problems.
 * Nothing with --quiet or --json. */
void findings_note(struct client *c, const cJSON *scene);
/* Adds warnings and problems to an object, where there are any. */
void findings_add(cJSON *object, const cJSON *scene);

#endif
