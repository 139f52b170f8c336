/* manual.c -- `manual`: the manual page and the completions, from the tables that --help is made
 * of. */
#include <string.h>

#include "client/commands.h"
#include "common/manual.h"
#include "common/reading.h"
#include "common/render_settings.h"
#include "common/settings.h"

/* Takes settings. */
static void setting_list(cJSON *settings) {
    const cJSON *setting;
    cJSON_ArrayForEach(setting, settings) {
        struct buf text;
        buf_init(&text, 8192);
        buf_printf(&text, "%s. Values: ", member_text(setting, "help"));
        setting_values(&text, setting);
        buf_puts(&text, ". Default: ");
        setting_default(&text, setting);
        manual_item(stdout, member_text(setting, "name"), NULL, buf_text(&text));
        buf_release(&text);
    }
    cJSON_Delete(settings);
}

static void page_1(void) {
    size_t count;
    const struct command *table = command_table(&count);
    manual_head(stdout, "UNBAKE", 1, "unbake", "take the light out of scanned rooms: the client");
    manual_section(stdout, "SYNOPSIS");
    for (size_t i = 0; i < count; i++)
        manual_synopsis(stdout, "unbake", table[i].name, table[i].arguments, true);
    manual_section(stdout, "DESCRIPTION");
    manual_text(stdout, "unbake sends rooms to unbaked(8), follows its jobs and fetches what comes out. A JOB is a "
                        "number, or `last` for the newest. Results go to stdout, progress and messages to stderr.\n");
    manual_section(stdout, "OPTIONS OF EVERY COMMAND");
    manual_options(stdout, command_shared_options, command_option_help);
    manual_section(stdout, "COMMANDS");
    for (size_t i = 0; i < count; i++) {
        manual_subsection(stdout, table[i].name, table[i].arguments);
        manual_sentence(stdout, table[i].summary);
        manual_text(stdout, table[i].details);
        manual_options(stdout, table[i].options, command_option_help);
        manual_example(stdout, table[i].examples);
    }
    manual_section(stdout, "SETTINGS");
    manual_text(stdout, "What `submit --set NAME=VALUE` takes. `unbake settings` asks the server for its own.\n");
    setting_list(settings_describe());
    manual_section(stdout, "SETTINGS OF RENDERS");
    manual_text(stdout, "What `render --set NAME=VALUE` takes; # stands for a number, that of a segment, a lamp or a "
                        "thing. `unbake settings --kind render` asks the server for its own.\n");
    setting_list(render_settings_describe());
    manual_section(stdout, "EXIT STATUS");
    for (size_t i = 0; command_exit_statuses[i].meaning; i++) {
        char status[12];
        snprintf(status, sizeof status, "%d", command_exit_statuses[i].status);
        manual_item(stdout, status, NULL, command_exit_statuses[i].meaning);
    }
    manual_section(stdout, "ENVIRONMENT");
    manual_item(stdout, "UNBAKE_SERVER", NULL, "the server's URL, or its name in the configuration");
    manual_item(stdout, "UNBAKE_TOKEN", NULL, "a token, in place of the one that `unbake login` kept");
    manual_item(stdout, "UNBAKE_CA", NULL, "certificates to trust for https, as --ca");
    manual_item(stdout, "NO_COLOR", NULL, "no colours");
    manual_item(stdout, "BROWSER", NULL, "what `unbake open` shows pages with");
    manual_section(stdout, "FILES");
    manual_text(stdout,
                "~/.config/unbake/config names servers: see `servers`. ~/.config/unbake/tokens holds the tokens "
                "that `unbake login` keeps. $XDG_CONFIG_HOME replaces ~/.config.\n");
    manual_section(stdout, "SEE ALSO");
    manual_text(stdout, "unbaked(8), unbaked.conf(5)\n");
}

static void completion(bool zsh) {
    size_t count;
    const struct command *table = command_table(&count);
    cJSON *settings = settings_describe();
    const cJSON *setting;
    completion_begin(stdout, "unbake", zsh);
    for (size_t i = 0; i < count; i++) {
        completion_words(stdout, table[i].name);
        completion_options(stdout, table[i].options);
        completion_options(stdout, command_shared_options);
        completion_words_end(stdout);
    }
    completion_words(stdout, "*");
    for (size_t i = 0; i < count; i++)
        completion_word(stdout, table[i].name, "");
    completion_words_end(stdout);
    completion_values(stdout);
    completion_words(stdout, "--set");
    cJSON_ArrayForEach(setting, settings)
        completion_word(stdout, member_text(setting, "name"), "=");
    completion_words_end(stdout);
    completion_words(stdout, "--scene-set");
    for (size_t i = 0; reading_keys[i]; i++)
        completion_word(stdout, reading_keys[i], "=");
    completion_words_end(stdout);
    completion_words(stdout, "--kind");
    for (size_t i = 0; command_job_kinds[i]; i++)
        completion_word(stdout, command_job_kinds[i], "");
    completion_words_end(stdout);
    completion_words(stdout, "--format");
    for (size_t i = 0; format_names[i]; i++)
        completion_word(stdout, format_names[i], "");
    completion_words_end(stdout);
    completion_words(stdout, "--state");
    for (size_t i = 0; command_job_states[i]; i++)
        completion_word(stdout, command_job_states[i], "");
    completion_words_end(stdout);
    completion_end(stdout, "unbake");
    cJSON_Delete(settings);
}

int manual_run(struct client *c, const struct options *o) {
    struct error err;
    const char *page = o->word[0];
    if (strcmp(page, "unbake.1") == 0) {
        page_1();
    } else if (strcmp(page, "bash") == 0 || strcmp(page, "zsh") == 0) {
        completion(page[0] == 'z');
    } else {
        error_set(&err, STATUS_INPUT, "unknown page \"%.100s\": unbake.1, bash, zsh", page);
        return client_fail(c, NULL, &err);
    }
    return CLIENT_OK;
}
