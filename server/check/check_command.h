/* check_command.h -- `unbaked check ROOM`: what a folder holds and whether it fits, without a daemon. */
#ifndef UNBAKE_CHECK_CHECK_COMMAND_H
#define UNBAKE_CHECK_CHECK_COMMAND_H

#include "server/arguments.h"

extern const struct command_option check_flags[];
int check_command(int argc, char **argv);

#endif
