/* assignment.c -- see assignment.h. */
#include "common/assignment.h"

#include <stddef.h>
#include <string.h>

char *assignment_trim(char *text) {
    text += strspn(text, " \t\r");
    size_t length = strlen(text);
    while (length > 0 && strchr(" \t\r", text[length - 1]))
        length--;
    text[length] = '\0';
    return text;
}

bool assignment_split(char *line, char **name, char **value) {
    char *equals = strchr(line, '=');
    if (equals)
        *equals = '\0';
    *name = assignment_trim(line);
    *value = equals ? assignment_trim(equals + 1) : NULL;
    return equals != NULL;
}
