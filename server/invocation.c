/* invocation.c -- see invocation.h. */
#include "server/invocation.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "common/mem.h"

/* Applies one flag that sets an option. */
static void apply_flag(struct config *c, const char *flag, const char *value, struct buf *problems) {
    if (strcmp(flag, "data") == 0)
        config_set(c, "data_dir", value, "--data", problems);
    if (strcmp(flag, "listen") == 0)
        config_set(c, "listen", value, "--listen", problems);
    if (strcmp(flag, "set") != 0)
        return;
    const char *equals = strchr(value, '=');
    if (!equals) {
        buf_printf(problems, "--set: \"%.100s\" is not of the form NAME=VALUE\n", value);
        return;
    }
    char *name = mem_strndup(value, (size_t)(equals - value));
    config_set(c, name, equals + 1, "--set", problems);
    mem_free(name);
}

static void read_config(struct invocation *in, const char *default_file, struct buf *problems) {
    struct error err;
    bool is_told = invocation_has(in, "config") || invocation_has(in, "data");
    if (!is_told && default_file && access(default_file, F_OK) == 0 &&
        config_read(&in->config, default_file, problems, &err) != STATUS_OK)
        buf_printf(problems, "%s\n", err.message);
    for (size_t i = 0; i < in->arguments.given_count; i++)
        if (strcmp(in->arguments.given[i].option->name, "config") == 0 &&
            config_read(&in->config, in->arguments.given[i].text, problems, &err) != STATUS_OK)
            buf_printf(problems, "%s\n", err.message);
    for (size_t i = 0; i < in->arguments.given_count; i++)
        if (in->arguments.given[i].text)
            apply_flag(&in->config, in->arguments.given[i].option->name, in->arguments.given[i].text, problems);
    config_check(&in->config, problems);
}

int invocation_read(struct invocation *in, int argc, char **argv, const struct command_option *flags,
                    const char *config_file) {
    memset(in, 0, sizeof *in);
    config_init(&in->config);
    if (!arguments_read(&in->arguments, argc, argv, flags))
        return EXIT_USAGE;
    if (invocation_has(in, "help") || invocation_has(in, "version"))
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
    options_release(&in->arguments);
    config_release(&in->config);
}
