/* arguments.c -- see arguments.h. */
#include "server/arguments.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

bool arguments_read(struct options *o, int argc, char **argv, const struct command_option *table) {
    struct error err;
    if (options_parse(o, argc - 1, argv + 1, table, NULL, &err) == STATUS_OK)
        return true;
    fprintf(stderr, "unbaked: %s%s%s\n", err.message, *err.hint ? "; " : "", err.hint);
    return false;
}

static bool read_number(const struct number_flag *flag, const char *text, double *value) {
    char *end;
    bool is_whole = !flag->real;
    errno = 0;
    *value = strtod(text, &end);
    if (errno == 0 && end != text && *end == '\0' && *value >= flag->low && *value <= flag->high &&
        (!is_whole || *value == floor(*value)))
        return true;
    fprintf(stderr, "unbaked: --%s must be a %snumber from %.16g to %.16g, not \"%s\"\n", flag->name,
            is_whole ? "whole " : "", flag->low, flag->high, text);
    return false;
}

bool arguments_numbers(const struct options *o, const struct number_flag *flags, size_t count) {
    for (size_t i = 0; i < count; i++) {
        const char *text = options_text(o, flags[i].name, NULL);
        double value;
        if (!text)
            continue;
        if (!read_number(&flags[i], text, &value))
            return false;
        if (flags[i].count)
            *flags[i].count = (uint32_t)value;
        else if (flags[i].large)
            *flags[i].large = (uint64_t)value;
        else
            *flags[i].real = (float)value;
    }
    return true;
}

int arguments_begin(struct options *o, int argc, char **argv, const struct command_option *table,
                    const struct number_flag *numbers, size_t number_count, size_t word_count) {
    int code = -1;
    if (!arguments_read(o, argc, argv, table))
        code = EXIT_USAGE;
    else if (options_flag(o, "help"))
        code = COMMAND_HELP;
    else if (!arguments_numbers(o, numbers, number_count))
        code = EXIT_USAGE;
    else if (o->word_count != word_count)
        code = COMMAND_MISUSED;
    if (code >= 0)
        options_release(o);
    return code;
}
