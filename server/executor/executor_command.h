/* executor_command.h -- `unbaked executor list | test NAME | probe [FILE]`. */
#ifndef UNBAKE_EXECUTOR_EXECUTOR_COMMAND_H
#define UNBAKE_EXECUTOR_EXECUTOR_COMMAND_H

#include "server/invocation.h"

extern const struct command_option executor_flags[];
int executor_command(int argc, char **argv);

#endif
