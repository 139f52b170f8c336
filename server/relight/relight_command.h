/* relight_command.h -- `unbaked relight OUTPUTS [OPTION]...`. */
#ifndef UNBAKE_RELIGHT_RELIGHT_COMMAND_H
#define UNBAKE_RELIGHT_RELIGHT_COMMAND_H

#include "server/arguments.h"

extern const struct command_option relight_flags[];

/* Returns an exit status, COMMAND_HELP or COMMAND_MISUSED; argv[0] is the command's name. */
int relight_command(int argc, char **argv);

#endif
