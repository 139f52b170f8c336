/* outcome.h -- a job that has ended: told to people, told to a command of theirs. */
#ifndef UNBAKE_CLIENT_OUTCOME_H
#define UNBAKE_CLIENT_OUTCOME_H

#include "client/client.h"

/* Prints how the job ended, with reason and hint, and what was wrong with its room. */
void outcome_print(struct client *c, const cJSON *job);
/* Runs a command by sh after the job's end, with $UNBAKE_JOB, $UNBAKE_STATE, $UNBAKE_NAME and $UNBAKE_REASON. Returns
 * `code`, the exit status so far, unless the command cannot be run. */
int outcome_run_command(struct client *c, int64_t job, const char *command, int code);
/* Runs `command` by sh, with `argument` (may be NULL) as $1, and waits for it. Its exit status; -1: it cannot be run,
 * or was ended by a signal. */
int outcome_shell(const char *command, const char *argument);

#endif
