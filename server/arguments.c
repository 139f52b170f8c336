/* arguments.c -- see arguments.h. */
#include "server/arguments.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/mem.h"
#include "common/nearest.h"

/* The flag named by the first `length` bytes of `text`; NULL with a message. */
static const struct flag *find_flag(const struct flag *flags, const char *text, size_t length) {
    struct nearest nearest;
    char *name = mem_strndup(text, length);
    const struct flag *found = NULL;
    nearest_init(&nearest, name);
    for (size_t i = 0; flags[i].name && !found; i++) {
        nearest_offer(&nearest, flags[i].name);
        if (strcmp(flags[i].name, name) == 0)
            found = &flags[i];
    }
    if (!found)
        fprintf(stderr, "unbaked: unknown option %s; %s%s%s\n", name, nearest.best ? "did you mean " : "",
                nearest.best ? nearest.best : "--help lists the options", nearest.best ? "?" : "");
    mem_free(name);
    return found;
}

bool arguments_read(struct arguments *a, int argc, char **argv, const struct flag *flags) {
    *a = (struct arguments){.word_count = 0};
    for (int i = 1; i < argc; i++) {
        if (argv[i][0] != '-') {
            if (a->word_count == WORDS_MAX) {
                fputs("unbaked: too many arguments\n", stderr);
                return false;
            }
            a->words[a->word_count++] = argv[i];
            continue;
        }
        size_t length = strcspn(argv[i], "=");
        const struct flag *flag = find_flag(flags, argv[i], length);
        if (!flag)
            return false;
        const char *value = argv[i][length] == '=' ? argv[i] + length + 1 : NULL;
        if (flag->value && !value && i + 1 < argc)
            value = argv[++i];
        if ((flag->value != NULL) != (value != NULL) || a->given_count == sizeof a->given / sizeof *a->given) {
            fprintf(stderr, "unbaked: %s %s\n", flag->name,
                    !flag->value ? "takes no value"
                    : value      ? "is given too often"
                                 : "needs a value");
            return false;
        }
        a->given[a->given_count].flag = flag;
        a->given[a->given_count++].value = value;
    }
    return true;
}

bool arguments_have(const struct arguments *a, const char *flag) {
    for (size_t i = 0; i < a->given_count; i++)
        if (strcmp(a->given[i].flag->name, flag) == 0)
            return true;
    return false;
}

const char *arguments_value(const struct arguments *a, const char *flag, const char *fallback) {
    for (size_t i = a->given_count; i-- > 0;)
        if (strcmp(a->given[i].flag->name, flag) == 0)
            return a->given[i].value;
    return fallback;
}

static bool read_number(const struct number_flag *flag, const char *text, double *value) {
    char *end;
    bool is_whole = !flag->real;
    errno = 0;
    *value = strtod(text, &end);
    if (errno == 0 && end != text && *end == '\0' && *value >= flag->low && *value <= flag->high &&
        (!is_whole || *value == floor(*value)))
        return true;
    fprintf(stderr, "unbaked: %s must be a %snumber from %.16g to %.16g, not \"%s\"\n", flag->name,
            is_whole ? "whole " : "", flag->low, flag->high, text);
    return false;
}

bool arguments_numbers(const struct arguments *a, const struct number_flag *flags, size_t count) {
    for (size_t i = 0; i < count; i++) {
        const char *text = arguments_value(a, flags[i].name, NULL);
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

int arguments_begin(struct arguments *a, int argc, char **argv, const struct flag *flags,
                    const struct number_flag *numbers, size_t number_count, size_t word_count) {
    if (!arguments_read(a, argc, argv, flags))
        return EXIT_USAGE;
    if (arguments_have(a, "--help"))
        return COMMAND_HELP;
    if (!arguments_numbers(a, numbers, number_count))
        return EXIT_USAGE;
    return a->word_count == word_count ? -1 : COMMAND_MISUSED;
}
