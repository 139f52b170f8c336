/* arguments.h -- what the commands share that read their options by themselves (getopt_long). */
#ifndef UNBAKE_SERVER_ARGUMENTS_H
#define UNBAKE_SERVER_ARGUMENTS_H

#include <stdbool.h>

#define EXIT_USAGE 2

/* The number that `text` says, in [low, high] and, where `is_whole`, whole. False where it is no such
 * number: then stderr tells which option of which command wants what. */
bool argument_number(const char *command, const char *option, const char *text, double low, double high,
                     bool is_whole, double *value);

#endif
