/* node_command.h -- `unbaked node URL`: one attempt of a job, on a machine that a scheduler gave. README.md. */
#ifndef UNBAKE_NODE_NODE_COMMAND_H
#define UNBAKE_NODE_NODE_COMMAND_H

#include "server/arguments.h"

extern const struct command_option node_flags[];
int node_command(int argc, char **argv);

#endif
