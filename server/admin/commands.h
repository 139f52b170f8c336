/* commands.h -- commands for whoever runs a daemon: tokens, usage, backups, diagnosis. */
#ifndef UNBAKE_ADMIN_COMMANDS_H
#define UNBAKE_ADMIN_COMMANDS_H

#include "server/invocation.h"

extern const struct command_option token_flags[], usage_flags[], backup_flags[], restore_flags[], check_config_flags[],
    doctor_flags[];

int token_command(int argc, char **argv);
int usage_command(int argc, char **argv);
int backup_command(int argc, char **argv);  /* backup.c */
int restore_command(int argc, char **argv); /* restore.c */
int check_config_command(int argc, char **argv);
int doctor_command(int argc, char **argv); /* doctor.c */

/* Reads options and configuration. -1: go on; else the command's exit status. `file` as for invocation_read. */
int command_begin(const char *file, struct invocation *in, int argc, char **argv, const struct command_option *flags,
                  size_t words_min, size_t words_max);
/* Prints the error to stderr; returns the exit status. */
int command_failed(const struct error *err);

/* A backup with outputs is a folder with state.db, scenes/, jobs/ and this list of its files, in sha256sum(1)'s
 * format. */
#define BACKUP_SUMS "SHA256SUMS"

#endif
