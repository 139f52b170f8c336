/* arguments.h -- the command line of `unbaked COMMAND`, read by a table of flags. Help, manual page and the shells'
 * completion are made from the same table. Messages go to stderr. */
#ifndef UNBAKE_SERVER_ARGUMENTS_H
#define UNBAKE_SERVER_ARGUMENTS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Exit status of wrong usage. */
#define EXIT_USAGE 2

/* What a command returns instead of an exit status to have its help printed: it was asked for, or the
 * arguments are wrong. */
enum { COMMAND_HELP = 256, COMMAND_MISUSED };

struct flag {
    const char *name;  /* "--config"; NULL ends a table */
    const char *value; /* name of its value in the help; NULL: it takes none */
    const char *help;
};

#define COMMAND_HELP_FLAG                                                                                              \
    { "--help", NULL, "print this help" }

#define WORDS_MAX 8

struct arguments {
    const char *words[WORDS_MAX]; /* what is no flag; borrowed from argv, as are the values */
    size_t word_count;
    struct {
        const struct flag *flag;
        const char *value; /* NULL where it takes none */
    } given[64];
    size_t given_count;
};

/* Reads argv[1...]; "--name value" and "--name=value" are the same. False, with a message, for an unknown flag, a
 * missing or unexpected value, or too many words. */
bool arguments_read(struct arguments *a, int argc, char **argv, const struct flag *flags);

bool arguments_have(const struct arguments *a, const char *flag);
/* The last value given, or `fallback`. */
const char *arguments_value(const struct arguments *a, const char *flag, const char *fallback);

/* A flag whose value is a number from `low` to `high`, stored through the one pointer that is not NULL; whole for the
 * first two. */
struct number_flag {
    const char *name;
    double low, high;
    uint32_t *count;
    uint64_t *large;
    float *real;
};

/* Stores the numbers of the flags that were given. False, with a message, where a value is no such number. */
bool arguments_numbers(const struct arguments *a, const struct number_flag *flags, size_t count);

/* How a command that takes word_count words begins: reads argv, then the numbers. -1: go on; else what the command
 * returns: EXIT_USAGE, after a message, COMMAND_HELP or COMMAND_MISUSED. */
int arguments_begin(struct arguments *a, int argc, char **argv, const struct flag *flags,
                    const struct number_flag *numbers, size_t number_count, size_t word_count);

#endif
