/* invocation.c -- see invocation.h. */
#include "server/invocation.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "common/mem.h"
#include "common/nearest.h"

/* The flag whose name the first `length` bytes of `text` are; NULL, with the problem told. */
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
        fprintf(stderr, "unbaked: what is \"%s\"? %s%s%s\n", name, nearest.best ? "did you mean " : "",
                nearest.best ? nearest.best : "--help lists what there is", nearest.best ? "?" : "");
    mem_free(name);
    return found;
}

static bool read_words(struct invocation *in, int argc, char **argv, const struct flag *flags) {
    for (int i = 1; i < argc; i++) {
        if (argv[i][0] != '-') {
            if (in->word_count == WORDS_MAX) {
                fputs("unbaked: too many words\n", stderr);
                return false;
            }
            in->words[in->word_count++] = argv[i];
            continue;
        }
        size_t length = strcspn(argv[i], "=");
        const struct flag *flag = find_flag(flags, argv[i], length);
        if (!flag)
            return false;
        const char *value = argv[i][length] == '=' ? argv[i] + length + 1 : NULL;
        if (flag->value && !value && i + 1 < argc)
            value = argv[++i];
        if ((flag->value != NULL) != (value != NULL) ||
            in->given_count == sizeof in->given / sizeof *in->given) {
            fprintf(stderr, "unbaked: %s %s\n", flag->name,
                    !flag->value ? "takes no value" : value ? "comes too often" : "needs a value");
            return false;
        }
        in->given[in->given_count].flag = flag;
        in->given[in->given_count++].value = value;
    }
    return true;
}

/* Applies one flag that sets an option. */
static void apply_flag(struct config *c, const char *flag, const char *value, struct buf *problems) {
    if (strcmp(flag, "--data") == 0)
        config_set(c, "data_dir", value, flag, problems);
    if (strcmp(flag, "--listen") == 0)
        config_set(c, "listen", value, flag, problems);
    if (strcmp(flag, "--set") != 0)
        return;
    const char *equals = strchr(value, '=');
    if (!equals) {
        buf_printf(problems, "--set: \"%s\" is not of the form NAME=VALUE\n", value);
        return;
    }
    char *name = mem_strndup(value, (size_t)(equals - value));
    config_set(c, name, equals + 1, flag, problems);
    mem_free(name);
}

static void read_config(struct invocation *in, const char *default_file, struct buf *problems) {
    struct error err;
    bool is_told = invocation_has(in, "--config") || invocation_has(in, "--data");
    if (!is_told && default_file && access(default_file, F_OK) == 0 &&
        config_read(&in->config, default_file, problems, &err) != STATUS_OK)
        buf_printf(problems, "%s\n", err.message);
    for (size_t i = 0; i < in->given_count; i++)
        if (strcmp(in->given[i].flag->name, "--config") == 0 &&
            config_read(&in->config, in->given[i].value, problems, &err) != STATUS_OK)
            buf_printf(problems, "%s\n", err.message);
    for (size_t i = 0; i < in->given_count; i++)
        if (in->given[i].value)
            apply_flag(&in->config, in->given[i].flag->name, in->given[i].value, problems);
    config_check(&in->config, problems);
}

int invocation_read(struct invocation *in, int argc, char **argv, const struct flag *flags,
                    const char *config_file) {
    memset(in, 0, sizeof *in);
    config_init(&in->config);
    if (!read_words(in, argc, argv, flags))
        return EXIT_USAGE;
    if (invocation_has(in, "--help") || invocation_has(in, "--version"))
        return -1;
    struct buf problems;
    buf_init(&problems, (size_t)1 << 20);
    read_config(in, config_file, &problems);
    if (problems.length > 0)
        fputs(buf_text(&problems), stderr);
    bool is_good = problems.length == 0;
    buf_release(&problems);
    return is_good ? -1 : EXIT_USAGE;
}

void invocation_release(struct invocation *in) {
    config_release(&in->config);
}

bool invocation_has(const struct invocation *in, const char *flag) {
    for (size_t i = 0; i < in->given_count; i++)
        if (strcmp(in->given[i].flag->name, flag) == 0)
            return true;
    return false;
}

const char *invocation_value(const struct invocation *in, const char *flag, const char *fallback) {
    for (size_t i = in->given_count; i-- > 0;)
        if (strcmp(in->given[i].flag->name, flag) == 0)
            return in->given[i].value;
    return fallback;
}
