/* trial_job.c -- see trial_job.h. */
#include "server/executor/trial_job.h"

#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "common/clock.h"
#include "common/file.h"
#include "common/json.h"
#include "common/mem.h"
#include "common/request.h"
#include "common/source_digest.h"
#include "server/executor/command.h"
#include "server/executor/job_status.h"

#define URL_SEC 5.0    /* in which the daemon must answer a node */
#define LOOK_SEC 1.0   /* between two looks at the job */
#define END_SEC 120.0  /* for a job to be seen to end, or to go once it is cancelled */
#define OUTPUT_LINES 5 /* of the command `info` that are shown: a version takes one or two */

struct attempt_at {
    const struct site *site;
    double begun; /* of the step */
    char name[64], id[64];
    bool failed;
};

static void sleep_sec(double seconds) {
    struct timespec pause = {.tv_sec = (time_t)seconds, .tv_nsec = (long)(1e9 * (seconds - (double)(time_t)seconds))};
    nanosleep(&pause, NULL);
}

/* --- on the node ----------------------------------------------------------------------------- */

enum status probe_url(const char *url, const char *ca, struct error *err) {
    static const struct request_advice advice = {.ca = "the key ca names the certificates to trust"};
    struct http_request *request = request_new(url, 0.0, -1);
    const struct request_call call = {.path = "/readyz", .silence_sec = URL_SEC, .once = true};
    struct reply reply;
    reply_init(&reply);
    request_set_advice(request, &advice);
    if (ca)
        request_set_ca(request, ca);
    enum status status = request_run(request, &call, &reply, err);
    if (reply.code > 0)
        status = STATUS_OK;
    reply_release(&reply);
    request_free(request);
    return status;
}

enum status probe_run(const struct node_probe *probe, struct error *err) {
    char host[64] = "";
    struct error why = {0};
    enum status status = probe->url ? probe_url(probe->url, probe->ca, &why) : STATUS_OK;
    sleep_sec(TRIAL_JOB_SEC);
    if (!probe->file) {
        *err = why;
        return status;
    }
    gethostname(host, sizeof host - 1);
    cJSON *said = cJSON_CreateObject();
    json_add_string(said, "host", host);
    json_add_string(said, "version", source_version);
    json_add_int(said, "unix_ms", clock_unix_ms());
    json_add_string(said, "url_error", status == STATUS_OK ? "" : why.message);
    char *text = json_text(said);
    status = file_replace(probe->file, text, strlen(text), err);
    mem_free(text);
    cJSON_Delete(said);
    return status;
}

/* --- here ------------------------------------------------------------------------------------ */

static void begin(struct attempt_at *t) { t->begun = clock_sec(); }

static void say(struct attempt_at *t, bool is_good, const char *step, const char *text) {
    printf("%-4s %-9s %6.2f s  %s\n", is_good ? "ok" : "FAIL", step, clock_sec() - t->begun, text);
    fflush(stdout);
    t->failed |= !is_good;
}

/* Runs a command; its output is the caller's (mem_free), NULL where it failed, which is said. */
static char *run(struct attempt_at *t, const char *step, char *const *words, const struct site_job *job, char *input) {
    struct buf output;
    struct error err;
    char **argv = site_words(t->site, words, job);
    buf_init(&output, COMMAND_OUTPUT_MAX);
    begin(t);
    enum status status = command_run(argv, input, t->site->deadline_sec, NULL, &output, &err);
    char *text = status == STATUS_OK ? mem_strdup(buf_text(&output)) : NULL;
    if (!text)
        say(t, false, step, err.message);
    buf_release(&output);
    words_free(argv);
    mem_free(input);
    return text;
}

static void try_info(struct attempt_at *t) {
    const struct site_job none = {.name = ""};
    char *text = t->site->info ? run(t, "info", t->site->info, &none, NULL) : NULL, *rest = text, *line;
    if (!text)
        return;
    say(t, true, "info", t->site->info[0]);
    for (int i = 0; i < OUTPUT_LINES && (line = strsep(&rest, "\n")) != NULL; i++)
        if (*line)
            printf("       %s\n", line);
    mem_free(text);
}

/* Submits a job that runs `command`. */
static bool try_submit(struct attempt_at *t, const char *random, const char *command) {
    struct line_parts parts;
    memset(&parts, 0, sizeof parts);
    snprintf(t->name, sizeof t->name, NAME_PREFIX "0-1-%s", random);
    const struct site_job job = {.name = t->name, .token = random, .command = command, .attempt = 1};
    char *text = run(t, "submit", t->site->submit, &job, site_script(t->site, &job));
    bool is_good = text != NULL;
    for (const char *at = text; at && *at && !parts.id[0];) {
        size_t length = strcspn(at, "\n");
        if (!*t->site->submit_id || !pattern_match(t->site->submit_id, at, length, &parts))
            parts.id[0] = '\0';
        at += length + (at[length] == '\n');
    }
    if (is_good && *t->site->submit_id && !parts.id[0]) {
        say(t, false, "submit", "its output has no line as submit_id says");
        is_good = false;
    } else if (is_good) {
        memcpy(t->id, parts.id, sizeof t->id);
        say(t, true, "submit", *t->id ? t->id : t->name);
    }
    mem_free(text);
    return is_good;
}

/* One look: the state of the job; SITE_UNKNOWN with *is_listed false: it is not there. False: the command failed. */
static bool look(struct attempt_at *t, enum site_state *state, bool *is_listed, char reason[128]) {
    struct job_status_list jobs = {0};
    double begun = t->begun;
    const struct site_job all = {.name = "", .ids = t->id};
    char *text = run(t, "status", t->site->status, &all, NULL);
    t->begun = begun;
    if (!text)
        return false;
    bool is_good = job_status_parse(&jobs, t->site, text);
    const struct job_status *job = job_status_find(&jobs, t->name);
    *is_listed = job != NULL;
    *state = job ? job->state : SITE_UNKNOWN;
    snprintf(reason, 128, "%s", job ? job->reason : "");
    if (job && job->id[0])
        memcpy(t->id, job->id, sizeof t->id);
    if (!is_good)
        say(t, false, "status", "its output has no line as status_line says");
    job_status_release(&jobs);
    mem_free(text);
    return is_good;
}

static bool is_alive(enum site_state state) { return state == SITE_WAITING || state == SITE_RUNNING; }

/* Follows the job until it has ended; says each change. */
static void follow(struct attempt_at *t, double wait_sec) {
    static const char *const words[] = {"unknown", "waiting", "running", "ended", "memory", "preempted"};
    enum site_state state, before = SITE_ENDED;
    bool is_listed, has_run = false, was_listed = false;
    char reason[128], told[128] = "";
    double until = clock_sec() + wait_sec;
    begin(t);
    while (clock_sec() < until) {
        if (!look(t, &state, &is_listed, reason))
            return;
        if (is_listed && (state != before || (state == SITE_WAITING && strcmp(reason, told) != 0)))
            say(t, state != SITE_UNKNOWN, words[state],
                state == SITE_UNKNOWN ? "a state that the file does not list" : reason);
        if (state == SITE_RUNNING && !has_run)
            until = clock_sec() + TRIAL_JOB_SEC + END_SEC;
        has_run |= state == SITE_RUNNING;
        if (is_listed && !is_alive(state) && state != SITE_UNKNOWN)
            return;
        if (!is_listed && was_listed) {
            say(t, true, "ended", "it is not listed any more");
            return;
        }
        was_listed |= is_listed;
        before = is_listed ? state : before;
        snprintf(told, sizeof told, "%s", reason);
        sleep_sec(LOOK_SEC);
    }
    say(t, false, "status", was_listed ? "it has not ended" : "the job does not appear in the output of status");
}

static void try_shared(struct attempt_at *t, const char *file) {
    cJSON *probe;
    struct error err;
    const char *host = "", *version = "", *url_error = "it does not say";
    double unix_ms = 0.0;
    char text[256];
    begin(t);
    if (json_read(file, 4096, &probe, &err) != STATUS_OK) {
        say(t, false, "shared", err.message);
        return;
    }
    (void)json_string(probe, "host", "probe", "", &host, NULL);
    (void)json_string(probe, "version", "probe", "", &version, NULL);
    (void)json_string(probe, "url_error", "probe", url_error, &url_error, NULL);
    (void)json_number(probe, "unix_ms", "probe", 0.0, &unix_ms, NULL);
    struct stat info;
    double apart = stat(file, &info) == 0 ? 1e-3 * unix_ms - (double)info.st_mtim.tv_sec : 0.0;
    snprintf(text, sizeof text, "%s wrote to it; its unbaked is %s, here it is %s", host, version, source_version);
    say(t, strcmp(version, source_version) == 0, "shared", text);
    snprintf(text, sizeof text, "the clock of %s and that of the folder are %.1f s apart", host, apart);
    say(t, apart < CLOCKS_APART_SEC && apart > -CLOCKS_APART_SEC, "clocks", text);
    snprintf(text, sizeof text, *url_error ? "%.60s: %.180s" : "%.60s reaches %.180s", host,
             *url_error ? url_error : t->site->url);
    say(t, !*url_error, "url", text);
    cJSON_Delete(probe);
    unlink(file);
}

/* A second one, which is cancelled at once. */
static void try_cancel(struct attempt_at *t, const char *random, const char *command) {
    enum site_state state = SITE_WAITING;
    bool is_listed = true;
    char reason[128];
    if (!try_submit(t, random, command) || !look(t, &state, &is_listed, reason))
        return;
    const struct site_job job = {.name = t->name, .id = t->id, .attempt = 1};
    char *text = run(t, "cancel", t->site->cancel, &job, NULL);
    if (!text)
        return;
    say(t, true, "cancel", t->name);
    mem_free(text);
    begin(t);
    for (double until = clock_sec() + END_SEC; clock_sec() < until; sleep_sec(LOOK_SEC)) {
        if (!look(t, &state, &is_listed, reason))
            return;
        if (!is_listed || !is_alive(state)) {
            say(t, true, "gone", "");
            return;
        }
    }
    say(t, false, "gone", "it is still there");
}

bool trial_job_run(const struct site *site, double wait_sec) {
    struct attempt_at t = {.site = site};
    char random[32];
    if (!*site->shared)
        printf("note: without a folder `shared`, whether nodes reach %s is not tried\n", site->url);
    snprintf(random, sizeof random, "%lx-%x", (unsigned long)clock_unix_ms(), (unsigned)getpid());
    char *file = *site->shared ? mem_printf("%s/" NAME_PREFIX "probe-%s", site->shared, random) : NULL;
    char *command = mem_printf("%s executor probe --url %s%s%s%s%s", site->node, site->url, *site->ca ? " --ca " : "",
                               site->ca, file ? " " : "", file ? file : "");
    try_info(&t);
    if (!t.failed && try_submit(&t, random, command)) {
        follow(&t, wait_sec);
        if (!t.failed && file)
            try_shared(&t, file);
        strcat(random, "2");
        if (!t.failed)
            try_cancel(&t, random, command);
    }
    mem_free(command);
    mem_free(file);
    return !t.failed;
}
