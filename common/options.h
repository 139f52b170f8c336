/* options.h -- parses a command line by a table of options, and prints the table for --help. Options and other words
 * may come in any order; `--name value`, `--name=value`, `-o value` and `-ovalue` are the same; `--` ends the options.
 * Texts are borrowed from argv. */
#ifndef UNBAKE_COMMON_OPTIONS_H
#define UNBAKE_COMMON_OPTIONS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#include "common/error.h"

enum option_kind {
    OPTION_FLAG,
    OPTION_TEXT,
    OPTION_LIST,   /* a text; may be given several times */
    OPTION_WHOLE,  /* a whole number of at most 9 digits, may be negative */
    OPTION_SECONDS /* a number of seconds (or of another unit, by the help), 0 or more */
};

struct command_option {
    const char *name; /* without the dashes; NULL ends a table */
    char letter;      /* 0: no short form */
    enum option_kind kind;
    const char *value; /* what the help calls the value: "DIR"; NULL for a flag */
    const char *help;  /* NULL: the program has it elsewhere (options_print) */
};

struct options_given {
    const struct command_option *option;
    const char *text; /* NULL for a flag */
};

struct options {
    struct options_given *given; /* [given_count], in the order of the command line; owned */
    size_t given_count;
    const char **word; /* [word_count] words that are not options; owned array of borrowed texts */
    size_t word_count;
};

/* Parses argv[count] by two tables (the command's own, and the shared one). On a mismatch STATUS_INPUT, with the
 * nearest valid name as hint. */
enum status options_parse(struct options *o, int count, char *const *argv, const struct command_option *own,
                          const struct command_option *shared, struct error *err);
void options_release(struct options *o);
/* A table for --help, a line each. `help_of`: of those without a help of their own; may be NULL where all have one. */
typedef const char *option_help(const struct command_option *option);
void options_print(const struct command_option *table, option_help *help_of, FILE *out);
/* Number of words that the option beginning with `word` takes; 0 if it is not in the table. */
int options_length(const char *word, const struct command_option *table);

bool options_flag(const struct options *o, const char *name);
/* The last value given, or `fallback`. */
const char *options_text(const struct options *o, const char *name, const char *fallback);
long options_whole(const struct options *o, const char *name, long fallback);
double options_seconds(const struct options *o, const char *name, double fallback);

#endif
