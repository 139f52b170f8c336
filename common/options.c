/* options.c -- see options.h. */
#include "common/options.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/mem.h"
#include "common/nearest.h"

static const struct command_option *find(const struct command_option *table, const char *name, size_t length) {
    for (; table && table->name; table++)
        if (strlen(table->name) == length && memcmp(table->name, name, length) == 0)
            return table;
    return NULL;
}

static const struct command_option *find_letter(const struct command_option *table, char letter) {
    for (; table && table->name; table++)
        if (table->letter == letter)
            return table;
    return NULL;
}

static void offer(struct nearest *nearest, const struct command_option *table) {
    for (; table && table->name; table++)
        nearest_offer(nearest, table->name);
}

static enum status unknown(const char *argument, const struct command_option *own, const struct command_option *shared,
                           struct error *err) {
    if (argument[1] != '-') {
        error_set(err, STATUS_INPUT, "unknown option -%c", argument[1]);
        return error_hint(err, "--help lists the options");
    }
    char *name = mem_strndup(argument + 2, strcspn(argument + 2, "="));
    struct nearest nearest;
    nearest_init(&nearest, name);
    offer(&nearest, own);
    offer(&nearest, shared);
    error_set(err, STATUS_INPUT, "unknown option --%s", name);
    enum status status = nearest.best ? error_hint(err, "did you mean --%s?", nearest.best)
                                      : error_hint(err, "--help lists the options");
    mem_free(name);
    return status;
}

static enum status check_value(const struct command_option *option, const char *text, struct error *err) {
    char *end;
    if (option->kind == OPTION_WHOLE) {
        long value = strtol(text, &end, 10);
        if (end == text || *end || strlen(text) > 10 || value > 999999999 || value < -999999999)
            return error_set(err, STATUS_INPUT, "--%s must be a whole number, not \"%s\"", option->name, text);
    }
    if (option->kind == OPTION_SECONDS) {
        double value = strtod(text, &end);
        if (end == text || *end || !isfinite(value) || value < 0.0 || value > 1e9)
            return error_set(err, STATUS_INPUT, "--%s must be a number, 0 or more, not \"%s\"", option->name, text);
    }
    return STATUS_OK;
}

/* The option that `argument` begins with; *text is a value in the same word, if any. */
static const struct command_option *read_option(const char *argument, const struct command_option *own,
                                                const struct command_option *shared, const char **text) {
    const struct command_option *option;
    *text = NULL;
    if (argument[1] == '-') {
        size_t length = strcspn(argument + 2, "=");
        option = find(own, argument + 2, length);
        if (argument[2 + length] == '=')
            *text = argument + 3 + length;
        return option ? option : find(shared, argument + 2, length);
    }
    option = find_letter(own, argument[1]);
    if (argument[2])
        *text = argument + 2;
    return option ? option : find_letter(shared, argument[1]);
}

int options_length(const char *word, const struct command_option *table) {
    const char *text;
    const struct command_option *option = word[0] == '-' && word[1] ? read_option(word, NULL, table, &text) : NULL;
    return !option ? 0 : option->kind == OPTION_FLAG || text ? 1 : 2;
}

enum status options_parse(struct options *o, int count, char *const *argv, const struct command_option *own,
                          const struct command_option *shared, struct error *err) {
    size_t room = count > 0 ? (size_t)count : 1;
    *o = (struct options){
        .given = mem_calloc(room, sizeof *o->given),
        .word = mem_calloc(room, sizeof *o->word),
    };
    bool options_ended = false;
    for (int i = 0; i < count; i++) {
        const char *argument = argv[i];
        if (options_ended || argument[0] != '-' || argument[1] == '\0') {
            o->word[o->word_count++] = argument;
            continue;
        }
        if (strcmp(argument, "--") == 0) {
            options_ended = true;
            continue;
        }
        const char *text;
        const struct command_option *option = read_option(argument, own, shared, &text);
        if (!option)
            return unknown(argument, own, shared, err);
        if (option->kind == OPTION_FLAG && text)
            return error_set(err, STATUS_INPUT, "--%s takes no value", option->name);
        if (option->kind != OPTION_FLAG && !text) {
            if (i + 1 >= count)
                return error_set(err, STATUS_INPUT, "--%s needs a value: --%s %s", option->name, option->name,
                                 option->value);
            text = argv[++i];
        }
        enum status status = check_value(option, text, err);
        if (status != STATUS_OK)
            return status;
        o->given[o->given_count++] = (struct options_given){.option = option, .text = text};
    }
    return STATUS_OK;
}

void options_release(struct options *o) {
    mem_free(o->given);
    mem_free(o->word);
    *o = (struct options){0};
}

static const struct options_given *last(const struct options *o, const char *name) {
    for (size_t i = o->given_count; i-- > 0;)
        if (strcmp(o->given[i].option->name, name) == 0)
            return &o->given[i];
    return NULL;
}

bool options_flag(const struct options *o, const char *name) { return last(o, name) != NULL; }

const char *options_text(const struct options *o, const char *name, const char *fallback) {
    const struct options_given *given = last(o, name);
    return given ? given->text : fallback;
}

long options_whole(const struct options *o, const char *name, long fallback) {
    const struct options_given *given = last(o, name);
    return given ? strtol(given->text, NULL, 10) : fallback;
}

double options_seconds(const struct options *o, const char *name, double fallback) {
    const struct options_given *given = last(o, name);
    return given ? strtod(given->text, NULL) : fallback;
}

/* The name and its value; the short forms have a column of their own where any option has one. */
void options_print(const struct command_option *table, option_help *help_of, FILE *out) {
    bool any_letter = false;
    for (const struct command_option *o = table; o && o->name; o++)
        any_letter = any_letter || o->letter;
    for (const struct command_option *o = table; o && o->name; o++) {
        char letter[5] = "    ";
        if (o->letter)
            snprintf(letter, sizeof letter, "-%c, ", o->letter);
        char *left =
            mem_printf("%s--%s%s%s", any_letter ? letter : "", o->name, o->value ? " " : "", o->value ? o->value : "");
        fprintf(out, "  %-22s %s\n", left, o->help ? o->help : help_of(o));
        mem_free(left);
    }
}
