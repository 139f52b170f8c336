/* commands.h -- what `unbaked NAME ...` does: one table, from which the help, the manual pages and
 * the shells' completion are made. */
#ifndef UNBAKE_SERVER_COMMANDS_H
#define UNBAKE_SERVER_COMMANDS_H

#include <stdio.h>

#include "server/invocation.h"

struct server_command {
    const char *name;      /* "" is the daemon itself */
    const char *arguments; /* "add NAME|list|revoke WHICH"; "" if it takes none */
    const char *summary;   /* one line */
    const char *details;   /* for the manual; "" if the summary says all */
    const char *example;
    const struct command_option *flags; /* NULL: it reads its words by itself */
    /* argv[0] is the command's name. An exit status, COMMAND_HELP or COMMAND_MISUSED. */
    int (*run)(int argc, char **argv);
};

/* The first is the daemon. */
const struct server_command *commands_table(size_t *count);
const struct server_command *commands_find(const char *name); /* NULL where there is none */
/* Of one command; of the whole program for the daemon's. */
void commands_help(const struct server_command *command, FILE *out);

/* manual.c: `unbaked manual PAGE` writes unbaked.8, unbaked.conf.5 or a completion. */
int manual_command(int argc, char **argv);

/* main.c */
int daemon_command(int argc, char **argv);
extern const struct command_option daemon_flags[];

#endif
