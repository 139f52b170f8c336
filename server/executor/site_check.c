/* site_check.c -- see site_check.h. */
#include "server/executor/site_check.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/clock.h"
#include "common/file.h"
#include "common/mem.h"
#include "common/source_digest.h"
#include "server/executor/command.h"
#include "server/executor/job_status.h"
#include "server/executor/trial_job.h"

struct examination {
    const struct site *site;
    void (*tell)(void *user, bool is_good, const char *text);
    void *user;
};

__attribute__((format(printf, 3, 4))) static void tell(const struct examination *e, bool is_good, const char *format,
                                                       ...) {
    char finding[1024];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(finding, sizeof finding, format, arguments);
    va_end(arguments);
    char *text = mem_printf("%s: %s", e->site->name, finding);
    e->tell(e->user, is_good, text);
    mem_free(text);
}

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

static bool examine_programs(const struct examination *e) {
    char *const *const commands[] = {e->site->submit, e->site->status, e->site->cancel, e->site->info};
    bool all = true;
    for (size_t i = 0; i < sizeof commands / sizeof *commands; i++) {
        if (!commands[i] || is_program(commands[i][0]))
            continue;
        tell(e, false, "there is no program %s", commands[i][0]);
        all = false;
    }
    return all;
}

static void examine_status(const struct examination *e) {
    const struct site_job all = {.name = "", .ids = ""};
    struct buf output;
    struct error err;
    struct job_status_list jobs = {0};
    char **argv = site_words(e->site, e->site->status, &all);
    buf_init(&output, COMMAND_OUTPUT_MAX);
    if (command_run(argv, NULL, e->site->deadline_sec, NULL, &output, &err) != STATUS_OK)
        tell(e, false, "%s", err.message);
    else if (!job_status_parse(&jobs, e->site, buf_text(&output)))
        tell(e, false, "the output of %s has no line as status_line says", argv[0]);
    else
        tell(e, true, "%s answers; %zu jobs of this daemon's kind", argv[0], jobs.count);
    job_status_release(&jobs);
    buf_release(&output);
    words_free(argv);
}

static void examine_url(const struct examination *e) {
    struct error err;
    /* it lies on the nodes, maybe here */
    const char *ca = *e->site->ca && access(e->site->ca, R_OK) == 0 ? e->site->ca : NULL;
    if (probe_url(e->site->url, ca, &err) == STATUS_OK)
        tell(e, true, "%s answers", e->site->url);
    else
        tell(e, false, "from here, %s", err.message);
}

/* A program on a shared disk, or of this machine's packages, is likely the one that the nodes have. */
static void examine_version(const struct examination *e) {
    char *const argv[] = {e->site->node, "--version", NULL};
    struct buf output;
    struct error err;
    if (!is_program(e->site->node))
        return;
    buf_init(&output, COMMAND_OUTPUT_MAX);
    enum status status = command_run(argv, NULL, e->site->deadline_sec, NULL, &output, &err);
    const char *line = buf_text(&output), *version = strncmp(line, "unbaked ", 8) == 0 ? line + 8 : line;
    int length = (int)strcspn(version, "\n");
    if (status != STATUS_OK)
        tell(e, false, "%s --version: %s", e->site->node, err.message);
    else if ((size_t)length == strlen(source_version) && strncmp(version, source_version, (size_t)length) == 0)
        tell(e, true, "%s, as it is here, is of this version", e->site->node);
    else
        tell(e, false, "%s, as it is here, is %.*s, and this is %s: nodes of another version are refused",
             e->site->node, length < 80 ? length : 80, version, source_version);
    buf_release(&output);
}

/* The clock that dates its files is the file server's. */
static void examine_shared(const struct examination *e) {
    struct stat info;
    if (!*e->site->shared)
        return;
    char *path = file_join(e->site->shared, "unbake-doctor-XXXXXX");
    int fd = mkstemp(path);
    bool is_written = fd >= 0 && write(fd, "\n", 1) == 1 && fsync(fd) == 0 && fstat(fd, &info) == 0;
    double now_sec = 1e-3 * (double)clock_unix_ms();
    if (fd >= 0) {
        close(fd);
        unlink(path);
    }
    if (is_written) {
        double apart = now_sec - (double)info.st_mtim.tv_sec - 1e-9 * (double)info.st_mtim.tv_nsec;
        tell(e, fabs(apart) < CLOCKS_APART_SEC,
             "the shared folder %s takes files; its clock and this machine's are %.1f s apart", e->site->shared, apart);
    } else {
        tell(e, false, "nothing can be written to the shared folder %s", e->site->shared);
    }
    mem_free(path);
}

void site_check(const struct site *site, void (*tell_each)(void *user, bool is_good, const char *text), void *user) {
    const struct examination e = {site, tell_each, user};
    if (examine_programs(&e))
        examine_status(&e);
    examine_url(&e);
    examine_version(&e);
    examine_shared(&e);
    tell(&e, true, "`unbaked executor test %s` tells the version and the clock of a node", site->name);
}
