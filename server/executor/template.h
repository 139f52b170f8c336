/* template.h -- what a site's administrator writes: commands as lists of words, texts with placeholders, and how a line
 * of a command's output looks. There is no shell anywhere. */
#ifndef UNBAKE_EXECUTOR_TEMPLATE_H
#define UNBAKE_EXECUTOR_TEMPLATE_H

#include <stddef.h>

#include "common/buf.h"
#include "common/error.h"

/* Takes `text` apart at white space; "..." holds white space together and is removed, \" is a quotation mark. *words:
 * NULL-terminated, the caller's (words_free). STATUS_INPUT where a quotation mark is left over, or there is no word. */
enum status words_parse(const char *text, char ***words, struct error *err);
void words_free(char **words);

/* A placeholder is {name}, of lower-case letters and _. "{{" stands for itself, and what follows it is no
 * placeholder. */
struct placeholder {
    const char *name, *value;
};
/* STATUS_INPUT names the first placeholder of `text` that is not one of known[count]. */
enum status template_check(const char *text, const struct placeholder *known, size_t count, struct error *err);
/* Appends `text` with the values in place; all placeholders are known. */
void template_fill(const char *text, const struct placeholder *known, size_t count, struct buf *to);

/* What a line says; each part is cut off where it does not fit, "" where the pattern has none. */
struct line_parts {
    char id[64], name[64], state[32], reason[128];
};
/* `pattern`: literal characters, a blank for one or more blanks, {id}, {name}, {state}, {reason} and {_} (of no
 * interest) for what lies between; the last one takes the rest of the line. False where the line does not look so.
 * `length`: of the line, without its newline. */
bool pattern_match(const char *pattern, const char *line, size_t length, struct line_parts *parts);
/* STATUS_INPUT where it has another placeholder, or two in a row. */
enum status pattern_check(const char *pattern, struct error *err);

#endif
