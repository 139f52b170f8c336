/* demo_command.h -- `unbaked demo-room DIR [OPTION]...`. */
#ifndef UNBAKE_DEMO_DEMO_COMMAND_H
#define UNBAKE_DEMO_DEMO_COMMAND_H

#include "server/arguments.h"

extern const struct command_option demo_flags[];

/* Returns an exit status, COMMAND_HELP or COMMAND_MISUSED; argv[0] is the command's name. */
int demo_command(int argc, char **argv);

#endif
