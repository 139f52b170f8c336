/* executor_command.h -- `unbaked executor list | test NAME | probe [FILE]`. */
#ifndef UNBAKE_EXECUTOR_EXECUTOR_COMMAND_H
#define UNBAKE_EXECUTOR_EXECUTOR_COMMAND_H

#include "server/executor/site.h"
#include "server/invocation.h"

extern const struct flag executor_flags[];
int executor_command(int argc, char **argv);

/* What `unbaked doctor` asks: whether the site's programs are there, its commands answer, and its url is reached. Calls
 * `tell` with each finding. */
void executor_examine(const struct site *site, void (*tell)(void *user, bool is_good, const char *text), void *user);

#endif
