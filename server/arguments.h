/* arguments.h -- how the commands of `unbaked` begin: their command line, read by a table (common/options.h), and the
 * numbers in it. Messages go to stderr. */
#ifndef UNBAKE_SERVER_ARGUMENTS_H
#define UNBAKE_SERVER_ARGUMENTS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/options.h"

/* Exit status of wrong usage. */
#define EXIT_USAGE 2

/* What a command returns instead of an exit status to have its help printed: it was asked for, or the
 * arguments are wrong. */
enum { COMMAND_HELP = 256, COMMAND_MISUSED };

#define COMMAND_HELP_FLAG                                                                                              \
    { "help", 0, OPTION_FLAG, NULL, "print this help" }

/* Reads argv[1...]. False, with a message, where options_parse finds a fault. The caller's (options_release) in any
 * case. */
bool arguments_read(struct options *o, int argc, char **argv, const struct command_option *table);

/* An option whose value is a number from `low` to `high`, stored through the one pointer that is not NULL; whole for
 * the first two. */
struct number_flag {
    const char *name;
    double low, high;
    uint32_t *count;
    uint64_t *large;
    float *real;
};

/* Stores the numbers of the options that were given. False, with a message, where a value is no such number. */
bool arguments_numbers(const struct options *o, const struct number_flag *flags, size_t count);

/* How a command that takes word_count words begins: reads argv, then the numbers. -1: go on; *o is the caller's
 * (options_release). Else what the command returns: EXIT_USAGE, after a message, COMMAND_HELP or COMMAND_MISUSED. */
int arguments_begin(struct options *o, int argc, char **argv, const struct command_option *table,
                    const struct number_flag *numbers, size_t number_count, size_t word_count);

#endif
