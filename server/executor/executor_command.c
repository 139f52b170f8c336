/* executor_command.c -- see executor_command.h. */
#include "server/executor/executor_command.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "common/file.h"
#include "common/mem.h"
#include "server/executor/sites.h"
#include "server/executor/trial_job.h"

#define WAIT_SEC 600 /* as the flag's line says */

const struct command_option executor_flags[] = {
    {"wait", 0, OPTION_TEXT, "SEC", "how long a test waits for its job to begin (600)"},
    {"url", 0, OPTION_TEXT, "URL", "of probe: the daemon that this machine should reach"},
    {"ca", 0, OPTION_TEXT, "FILE", "of probe: certificates to trust instead of the system's"},
    INVOCATION_FLAGS,
    COMMAND_HELP_FLAG,
    {0},
};

static int list(const struct config *c) {
    struct sites sites;
    struct buf none;
    buf_init(&none, 1 << 16);
    sites_read(&sites, c->executors, c->executors_dir, &none); /* was checked with the rest */
    for (size_t i = 0; i < sites.count; i++) {
        const struct site_place *place = &sites.place[i];
        if (place->is_process)
            printf("%-12s %4lld jobs  this machine\n", JOB_EXECUTOR_HERE, (long long)c->max_running);
        else
            printf("%-12s %4.0f jobs  %s, %.0f threads each; nodes reach %s\n", place->site.name,
                   place->site.max_running, place->site.submit[0], place->site.threads, place->site.url);
    }
    sites_release(&sites);
    buf_release(&none);
    return EXIT_SUCCESS;
}

static int test(const struct config *c, const char *name, double wait_sec) {
    struct site site;
    struct buf problems;
    struct error err;
    char *file = mem_printf("%s.conf", name), *path = file_join(c->executors_dir, file);
    bool is_good = false;
    memset(&site, 0, sizeof site);
    buf_init(&problems, 1 << 16);
    enum status status = site_name_is_good(name) ? site_read(&site, name, path, &problems, &err)
                                                 : error_set(&err, STATUS_INPUT, "\"%s\" is no executor's name", name);
    if (status != STATUS_OK)
        fprintf(stderr, "unbaked: %s\n", err.message);
    else if (problems.length > 0)
        fprintf(stderr, "%s", buf_text(&problems));
    else
        is_good = trial_job_run(&site, wait_sec);
    if (status == STATUS_OK || site.where)
        site_release(&site);
    int code = is_good ? EXIT_SUCCESS : status == STATUS_OK && problems.length == 0 ? EXIT_FAILURE : EXIT_USAGE;
    buf_release(&problems);
    mem_free(path);
    mem_free(file);
    return code;
}

int executor_command(int argc, char **argv) {
    struct invocation in;
    struct error err;
    int code = invocation_read(&in, argc, argv, executor_flags, CONFIG_FILE_DEFAULT);
    const struct options *a = &in.arguments;
    const char *word = code < 0 && a->word_count > 0 ? a->word[0] : "";
    uint32_t wait_sec = WAIT_SEC;
    const struct number_flag numbers[] = {{"wait", 0, 86400, .count = &wait_sec}};
    if (code < 0 && invocation_has(&in, "help"))
        code = COMMAND_HELP;
    else if (code < 0 && !arguments_numbers(a, numbers, 1))
        code = EXIT_USAGE;
    else if (code < 0 && strcmp(word, "list") == 0 && a->word_count == 1)
        code = list(&in.config);
    else if (code < 0 && strcmp(word, "test") == 0 && a->word_count == 2)
        code = test(&in.config, a->word[1], wait_sec);
    else if (code < 0 && strcmp(word, "probe") == 0 && a->word_count <= 2) {
        const struct node_probe probe = {.file = a->word_count == 2 ? a->word[1] : NULL,
                                         .url = invocation_value(&in, "url", NULL),
                                         .ca = invocation_value(&in, "ca", NULL)};
        code = probe_run(&probe, &err) == STATUS_OK ? EXIT_SUCCESS : EXIT_FAILURE;
        if (code != EXIT_SUCCESS)
            fprintf(stderr, "unbaked: %s\n", err.message);
    } else if (code < 0)
        code = COMMAND_MISUSED;
    invocation_release(&in);
    return code;
}
