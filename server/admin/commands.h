/* commands.h -- the commands for whoever runs a daemon: tokens, backups, what is wrong here. */
#ifndef UNBAKE_ADMIN_COMMANDS_H
#define UNBAKE_ADMIN_COMMANDS_H

#include "server/invocation.h"

extern const struct flag token_flags[], backup_flags[], check_config_flags[], doctor_flags[];

int token_command(int argc, char **argv);
int backup_command(int argc, char **argv);
int check_config_command(int argc, char **argv);
int doctor_command(int argc, char **argv); /* doctor.c */

#endif
