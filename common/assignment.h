/* assignment.h -- lines "name = value" of files that people write. */
#ifndef UNBAKE_COMMON_ASSIGNMENT_H
#define UNBAKE_COMMON_ASSIGNMENT_H

#include <stdbool.h>

/* The text without blanks, tabs and carriage returns at its ends; changes it. */
char *assignment_trim(char *text);
/* Splits a line at its first "=", both parts without white space at their ends; changes it. False, with *name the whole
 * line, where it has none. */
bool assignment_split(char *line, char **name, char **value);

#endif
