/* evaluate_command.h -- `unbaked evaluate ROOM OUTPUTS [OPTION]...`. */
#ifndef UNBAKE_EVALUATE_EVALUATE_COMMAND_H
#define UNBAKE_EVALUATE_EVALUATE_COMMAND_H

#include "server/arguments.h"

extern const struct command_option evaluate_flags[];

/* Returns an exit status, COMMAND_HELP or COMMAND_MISUSED; argv[0] is the command's name. */
int evaluate_command(int argc, char **argv);

#endif
