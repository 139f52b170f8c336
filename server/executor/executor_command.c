/* executor_command.c -- see executor_command.h. */
#include "server/executor/executor_command.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "common/file.h"
#include "common/mem.h"
#include "server/executor/command.h"
#include "server/executor/listed.h"
#include "server/executor/sites.h"
#include "server/executor/try.h"

#define WAIT_SEC "600"

const struct flag executor_flags[] = {
    {"--wait", "SEC", "how long a test waits for its job to begin (" WAIT_SEC ")"},
    {"--url", "URL", "of probe: the daemon that this machine should reach"},
    {"--ca", "FILE", "of probe: certificates to trust instead of the system's"},
    INVOCATION_FLAGS,
    COMMAND_HELP_FLAG,
    {0},
};

/* --- for doctor ------------------------------------------------------------------------------ */

/* Whether a program is there, in PATH or by its path. */
static bool is_program(const char *name) {
    const char *path = getenv("PATH");
    bool found = strchr(name, '/') && access(name, X_OK) == 0;
    char *copy = mem_strdup(path ? path : "/usr/bin:/bin"), *rest = copy, *dir;
    while (!found && !strchr(name, '/') && (dir = strsep(&rest, ":")) != NULL) {
        char *full = file_join(*dir ? dir : ".", name);
        found = access(full, X_OK) == 0;
        mem_free(full);
    }
    mem_free(copy);
    return found;
}

static bool examine_programs(const struct site *site, void (*tell)(void *, bool, const char *), void *user) {
    char *const *const commands[] = {site->submit, site->status, site->cancel, site->info};
    bool all = true;
    for (size_t i = 0; i < sizeof commands / sizeof *commands; i++) {
        if (!commands[i] || is_program(commands[i][0]))
            continue;
        char *text = mem_printf("%s: there is no program %s", site->name, commands[i][0]);
        tell(user, false, text);
        mem_free(text);
        all = false;
    }
    return all;
}

static void examine_status(const struct site *site, void (*tell)(void *, bool, const char *), void *user) {
    const struct site_job all = {.name = "", .ids = ""};
    struct buf output;
    struct error err;
    struct listed_jobs jobs = {0};
    char **argv = site_words(site, site->status, &all), *text;
    buf_init(&output, COMMAND_OUTPUT_MAX);
    if (command_run(argv, NULL, site->deadline_sec, NULL, &output, &err) != STATUS_OK)
        text = mem_printf("%s: %s", site->name, err.message);
    else if (!listed_read(&jobs, site, buf_text(&output)))
        text = mem_printf("%s: the output of %s has no line as status_line says", site->name, argv[0]);
    else
        text = mem_printf("%s: %s answers; %zu jobs of this daemon's kind", site->name, argv[0], jobs.count);
    tell(user, jobs.job || strstr(text, "answers"), text);
    mem_free(text);
    listed_release(&jobs);
    buf_release(&output);
    words_free(argv);
}

static void examine_url(const struct site *site, void (*tell)(void *, bool, const char *), void *user) {
    struct error err;
    const char *ca = *site->ca && access(site->ca, R_OK) == 0 ? site->ca : NULL; /* it lies on the nodes, maybe here */
    bool is_good = probe_url(site->url, ca, &err) == STATUS_OK;
    char *text = is_good ? mem_printf("%s: %s answers", site->name, site->url)
                         : mem_printf("%s: from here, %s", site->name, err.message);
    tell(user, is_good, text);
    mem_free(text);
}

void executor_examine(const struct site *site, void (*tell)(void *user, bool is_good, const char *text), void *user) {
    if (examine_programs(site, tell, user))
        examine_status(site, tell, user);
    examine_url(site, tell, user);
    if (*site->shared && access(site->shared, W_OK) != 0) {
        char *text = mem_printf("%s: nothing can be written to the shared folder %s", site->name, site->shared);
        tell(user, false, text);
        mem_free(text);
    }
}

/* --- the command ----------------------------------------------------------------------------- */

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
        is_good = try_site(&site, wait_sec);
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
    const struct arguments *a = &in.arguments;
    const char *word = code < 0 && a->word_count > 0 ? a->words[0] : "";
    double wait_sec = strtod(invocation_value(&in, "--wait", WAIT_SEC), NULL);
    if (code < 0 && invocation_has(&in, "--help"))
        code = COMMAND_HELP;
    else if (code < 0 && strcmp(word, "list") == 0 && a->word_count == 1)
        code = list(&in.config);
    else if (code < 0 && strcmp(word, "test") == 0 && a->word_count == 2)
        code = test(&in.config, a->words[1], wait_sec);
    else if (code < 0 && strcmp(word, "probe") == 0 && a->word_count <= 2) {
        const struct node_probe probe = {.file = a->word_count == 2 ? a->words[1] : NULL,
                                         .url = invocation_value(&in, "--url", NULL),
                                         .ca = invocation_value(&in, "--ca", NULL)};
        code = probe_run(&probe, &err) == STATUS_OK ? EXIT_SUCCESS : EXIT_FAILURE;
        if (code != EXIT_SUCCESS)
            fprintf(stderr, "unbaked: %s\n", err.message);
    } else if (code < 0)
        code = COMMAND_MISUSED;
    invocation_release(&in);
    return code;
}
