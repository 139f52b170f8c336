/* arguments.c -- see arguments.h. */
#include "server/arguments.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

bool argument_number(const char *command, const char *option, const char *text, double low, double high,
                     bool is_whole, double *value) {
    char *end;
    errno = 0;
    *value = strtod(text, &end);
    if (errno == 0 && end != text && *end == '\0' && *value >= low && *value <= high &&
        (!is_whole || *value == floor(*value)))
        return true;
    fprintf(stderr, "unbaked %s: --%s wants a %snumber from %.16g to %.16g, not '%s'\n", command, option,
            is_whole ? "whole " : "", low, high, text);
    return false;
}
