/* outcome.c -- see outcome.h. */
#include "client/outcome.h"

#include <math.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "client/findings.h"
#include "client/view.h"
#include "common/mem.h"
#include "common/protocol.h"

static void print_rejection(struct client *c, const cJSON *job) {
    struct reply reply;
    reply_init(&reply);
    char *path = mem_printf("/v1/scenes/%s", member_text(job, "scene"));
    if (request_get(c->request, path, &reply, NULL) == STATUS_OK)
        findings_print_faults(c, reply.json);
    mem_free(path);
    reply_release(&reply);
}

void outcome_print(struct client *c, const cJSON *job) {
    const char *state = member_text(job, "state");
    double started = time_parse(member_text(job, "started_at"));
    double finished = time_parse(member_text(job, "finished_at"));
    long long id = member_whole(job, "id", 0);
    FILE *out = c->out.out;
    terminal_clear(&c->out);
    fprintf(out, "job %lld %s%s%s", id, terminal_colour(&c->out, state_colour(state)), state,
            terminal_colour(&c->out, COLOUR_NONE));
    if (isfinite(started) && isfinite(finished)) {
        char took[16];
        format_duration(took, finished - started);
        fprintf(out, " after %s", took);
    }
    struct buf text;
    buf_init(&text, 1 << 16);
    if (*member_text(job, "reason")) {
        buf_puts(&text, ": ");
        terminal_clean(&text, member_text(job, "reason"));
    }
    if (*member_text(job, "hint")) {
        buf_puts(&text, "\n  hint: ");
        terminal_clean(&text, member_text(job, "hint"));
    }
    fprintf(out, "%s\n", buf_text(&text));
    buf_release(&text);
    if (strcmp(state, JOB_STATE_SUCCEEDED) == 0)
        fprintf(out, "fetch its outputs with: unbake get %lld\n", id);
    else if (strcmp(state, JOB_STATE_FAILED) == 0)
        print_rejection(c, job);
}

int outcome_shell(const char *command, const char *argument) {
    sigset_t none;
    int status;
    fflush(NULL);
    pid_t pid = fork();
    if (pid == 0) { /* main blocks signals; the command needs them */
        sigemptyset(&none);
        sigprocmask(SIG_SETMASK, &none, NULL);
        execl("/bin/sh", "sh", "-c", command, "sh", argument, (char *)NULL);
        _exit(127);
    }
    return pid > 0 && waitpid(pid, &status, 0) == pid && WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

int outcome_run_command(struct client *c, int64_t job, const char *command, int code) {
    struct reply reply;
    struct error err;
    char number[24];
    reply_init(&reply);
    if (client_job_get(c, job, &reply, &err) != STATUS_OK) {
        code = client_fail(c, &reply, &err);
        reply_release(&reply);
        return code;
    }
    snprintf(number, sizeof number, "%lld", (long long)job);
    setenv("UNBAKE_JOB", number, 1);
    setenv("UNBAKE_STATE", member_text(reply.json, "state"), 1);
    setenv("UNBAKE_NAME", member_text(reply.json, "name"), 1);
    setenv("UNBAKE_REASON", member_text(reply.json, "reason"), 1);
    reply_release(&reply);
    int ended = outcome_shell(command, NULL);
    if (ended >= 0 && ended < 126)
        return code;
    error_set(&err, STATUS_INTERNAL, "--exec: the command could not be run");
    client_fail(c, NULL, &err);
    return CLIENT_LOCAL;
}
