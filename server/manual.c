/* manual.c -- the manual pages and the completions, from the tables that --help is made of. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/manual.h"
#include "server/commands.h"

static void page_8(void) {
    size_t count;
    const struct server_command *table = commands_table(&count);
    manual_head(stdout, "UNBAKED", 8, "unbaked", "take the light out of scanned rooms: the daemon");
    manual_section(stdout, "SYNOPSIS");
    for (size_t i = 0; i < count; i++)
        manual_synopsis(stdout, "unbaked", table[i].name, table[i].arguments, table[i].flags != NULL);
    manual_section(stdout, "DESCRIPTION");
    manual_text(stdout, "unbaked takes scenes over HTTP (a triangle mesh, photographs, their cameras), and "
                        "reconstructs what their surfaces are made of and what lights them. Jobs survive crashes and "
                        "restarts. unbake(1) is its client.\n");
    manual_text(stdout, table[0].details);
    manual_section(stdout, "OPTIONS");
    manual_options(stdout, table[0].flags, NULL);
    manual_section(stdout, "COMMANDS");
    for (size_t i = 1; i < count; i++) {
        manual_subsection(stdout, table[i].name, table[i].arguments);
        manual_sentence(stdout, table[i].summary);
        manual_text(stdout, table[i].details);
        manual_options(stdout, table[i].flags, NULL);
        manual_example(stdout, table[i].example);
    }
    manual_section(stdout, "EXIT STATUS");
    manual_text(stdout, "0 done, or stopped when asked to; 1 failed; 2 bad usage or configuration.\n");
    manual_section(stdout, "FILES");
    manual_item(stdout, CONFIG_FILE_DEFAULT, NULL,
                "what the commands read where neither --config nor --data "
                "is given; the daemon reads what its --config names");
    manual_item(stdout, "/var/lib/unbaked", NULL, "the data folder: state.db, scenes, jobs, admin.sock");
    manual_section(stdout, "SEE ALSO");
    manual_text(stdout, "unbake(1), unbaked.conf(5)\n");
}

static void page_5(void) {
    size_t count;
    const struct config_option *table = config_table(&count);
    manual_head(stdout, "UNBAKED.CONF", 5, "unbaked.conf", "configuration of unbaked");
    manual_section(stdout, "DESCRIPTION");
    manual_text(stdout,
                "Lines read \"name = value\"; # begins a comment. The same options are taken by --set on "
                "the command line, which wins. `unbaked check-config` says everything that is wrong with a file.\n");
    manual_section(stdout, "OPTIONS");
    for (size_t i = 0; i < count; i++) {
        char range[160] = "", text[800];
        if (table[i].type == CONFIG_INT || table[i].type == CONFIG_REAL)
            snprintf(range, sizeof range, " %.15g to %.15g%s%s.", table[i].minimum, table[i].maximum,
                     *table[i].unit ? " " : "", table[i].unit);
        else if (table[i].type == CONFIG_BOOL)
            snprintf(range, sizeof range, " yes or no.");
        snprintf(text, sizeof text, "%s%s Default: %s", table[i].help, range,
                 *table[i].default_text ? table[i].default_text : "empty");
        manual_item(stdout, table[i].name, NULL, text);
    }
    manual_section(stdout, "SEE ALSO");
    manual_text(stdout, "unbaked(8)\n");
}

static void words(const char *pattern, const char *const *list) {
    completion_words(stdout, pattern);
    for (; *list; list++)
        completion_word(stdout, *list, "");
    completion_words_end(stdout);
}

static void completion(bool zsh) {
    static const char *const actions[] = {"add", "list", "revoke", NULL};
    static const char *const roles[] = {"viewer", "user", "admin", NULL};
    size_t count, option_count;
    const struct server_command *table = commands_table(&count);
    const struct config_option *options = config_table(&option_count);
    completion_begin(stdout, "unbaked", zsh);
    for (size_t i = count; i-- > 0;) { /* the daemon, whose pattern is *, comes last */
        completion_words(stdout, i > 0 ? table[i].name : "*");
        completion_options(stdout, table[i].flags);
        for (size_t k = 1; i == 0 && k < count; k++)
            completion_word(stdout, table[k].name, "");
        completion_words_end(stdout);
    }
    completion_values(stdout);
    words("token", actions);
    words("--role", roles);
    completion_words(stdout, "--set");
    for (size_t i = 0; i < option_count; i++)
        completion_word(stdout, options[i].name, "=");
    completion_words_end(stdout);
    completion_end(stdout, "unbaked");
}

int manual_command(int argc, char **argv) {
    const char *page = argc == 2 ? argv[1] : "";
    if (strcmp(page, "unbaked.8") == 0)
        page_8();
    else if (strcmp(page, "unbaked.conf.5") == 0)
        page_5();
    else if (strcmp(page, "bash") == 0 || strcmp(page, "zsh") == 0)
        completion(page[0] == 'z');
    else {
        fputs("usage: unbaked manual unbaked.8|unbaked.conf.5|bash|zsh\n", stderr);
        return EXIT_USAGE;
    }
    return EXIT_SUCCESS;
}
