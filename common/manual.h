/* manual.h -- writes manual pages (man(7)) and shell completions from tables. Text is escaped for roff and the shell
 * here. */
#ifndef UNBAKE_COMMON_MANUAL_H
#define UNBAKE_COMMON_MANUAL_H

#include <stdbool.h>
#include <stdio.h>

#include "common/options.h"

void manual_head(FILE *out, const char *title, int section, const char *name, const char *summary);
void manual_section(FILE *out, const char *title);
void manual_subsection(FILE *out, const char *name, const char *arguments);
/* "program name arguments [OPTION]..." on a line of its own. */
void manual_synopsis(FILE *out, const char *program, const char *name, const char *arguments, bool has_options);
void manual_text(FILE *out, const char *text);     /* a paragraph; "": none */
void manual_sentence(FILE *out, const char *text); /* a paragraph made a sentence: capital letter and full stop */
void manual_item(FILE *out, const char *word, const char *value, const char *text);       /* value may be NULL */
void manual_options(FILE *out, const struct command_option *table, option_help *help_of); /* as options_print */
void manual_example(FILE *out, const char *lines);                                        /* "": none */

/* A completion is: begin; words, word..., words_end per command, the last for "*", the program itself; values; the
 * same for words that are completed by the previous word; end. */
void completion_begin(FILE *out, const char *program, bool zsh);
void completion_words(FILE *out, const char *pattern);
void completion_word(FILE *out, const char *word, const char *after);   /* both together are the word */
void completion_options(FILE *out, const struct command_option *table); /* as words */
void completion_words_end(FILE *out);
void completion_values(FILE *out);
void completion_end(FILE *out, const char *program);

#endif
