/* options.h -- a command line as a table of options says it should be.
 *
 * Options and other words may come in any order; `--name value`, `--name=value`, `-o value` and
 * `-ovalue` are the same; `--` ends the options. Nothing is copied: texts are borrowed from argv. */
#ifndef UNBAKE_CLIENT_OPTIONS_H
#define UNBAKE_CLIENT_OPTIONS_H

#include <stdbool.h>
#include <stddef.h>

#include "common/error.h"

enum option_kind {
    OPTION_FLAG,
    OPTION_TEXT,
    OPTION_LIST,   /* a text that may be given again and again */
    OPTION_WHOLE,  /* a whole number of at most 9 digits, may be negative */
    OPTION_SECONDS /* a number of seconds (or what the help says), 0 or more */
};

struct client_option {
    const char *name; /* without the dashes; NULL ends a table */
    char letter;      /* 0: no short form */
    enum option_kind kind;
    const char *value; /* what the help calls the value: "DIR"; NULL for a flag */
    const char *help;
};

struct options_given {
    const struct client_option *option;
    const char *text; /* NULL for a flag */
};

struct options {
    struct options_given *given; /* [given_count], in the order of the command line; owned */
    size_t given_count;
    const char **word; /* [word_count] what is no option; owned array of borrowed texts */
    size_t word_count;
};

/* Parses argv[count] by two tables (a command's own, then the ones that all commands share).
 * STATUS_INPUT, with the nearest valid name as the hint, when it does not fit them. */
enum status options_parse(struct options *o, int count, char *const *argv, const struct client_option *own,
                          const struct client_option *shared, struct error *err);
void options_release(struct options *o);
/* How many words the option that begins with `word` takes of a command line, by that table; 0 where it is
 * none of them. */
int options_length(const char *word, const struct client_option *table);

bool options_flag(const struct options *o, const char *name);
/* The last value given, or `fallback`. */
const char *options_text(const struct options *o, const char *name, const char *fallback);
long options_whole(const struct options *o, const char *name, long fallback);
double options_seconds(const struct options *o, const char *name, double fallback);

#endif
