/* commands.h -- the commands for whoever runs a daemon: tokens, backups, what is wrong here. */
#ifndef UNBAKE_ADMIN_COMMANDS_H
#define UNBAKE_ADMIN_COMMANDS_H

#include "server/invocation.h"

extern const struct flag token_flags[], backup_flags[], restore_flags[], check_config_flags[], doctor_flags[];

int token_command(int argc, char **argv);
int backup_command(int argc, char **argv);  /* backup.c */
int restore_command(int argc, char **argv); /* restore.c */
int check_config_command(int argc, char **argv);
int doctor_command(int argc, char **argv); /* doctor.c */

/* -1 to go on, or what the command returns. `file` as for invocation_read. */
int command_begin(const char *file, struct invocation *in, int argc, char **argv, const struct flag *flags,
                  size_t words_min, size_t words_max);
/* Tells the error on stderr; the exit status. */
int command_failed(const struct error *err);

/* A backup with outputs: a folder with state.db, scenes/ and jobs/, and this list of its files, as sha256sum(1)
 * writes it. */
#define BACKUP_SUMS "SHA256SUMS"

#endif
