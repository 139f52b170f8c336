/* wait.c -- `wait`: blocks until jobs have ended, for scripts. Asks for each job's state, through restarts of the
 * server; `watch` is for people, and follows the events of one job. */
#include <math.h>
#include <string.h>

#include "client/commands.h"
#include "client/format.h"
#include "client/outcome.h"
#include "client/view.h"
#include "common/clock.h"
#include "common/mem.h"
#include "common/protocol.h"

#define ROUND_SEC 2.0      /* between two rounds of questions, once nothing has ended for a while */
#define PATIENCE_SEC 600.0 /* for which a server may be away that has answered once, as `watch` has it */

const struct command_option wait_options[] = {
    {"any", 0, OPTION_FLAG, NULL, "until the first of them has ended, not all"},
    {"timeout", 't', OPTION_SECONDS, "SEC", "at most so long; then ends with 9"},
    FORMAT_OPTION,
    {0},
};

struct waiting {
    struct client *client;
    int64_t *open; /* [open_count] the jobs that have not ended; owned */
    size_t open_count, ended, failed, cancelled;
    double heard_at; /* when the server last answered */
    bool ever, told;
    bool told_paused; /* that a job is paused; said once, of the first */
};

static void tell_paused(struct waiting *w, const cJSON *job) {
    double id = member_number(job, "id", 0.0);
    if (w->told_paused || strcmp(member_text(job, "state"), JOB_STATE_PAUSED) != 0)
        return;
    client_note(w->client, "job %.0f is paused, and waited for: `unbake resume %.0f` lets it go on", id, id);
    w->told_paused = true;
}

/* Counts the job's end, if that is its state, and tells it. Whether it has ended. */
static bool take(struct waiting *w, const cJSON *job) {
    struct client *c = w->client;
    const char *state = member_text(job, "state");
    bool cancelled = strcmp(state, JOB_STATE_CANCELLED) == 0, failed = strcmp(state, JOB_STATE_FAILED) == 0;
    if (!cancelled && !failed && strcmp(state, JOB_STATE_SUCCEEDED) != 0)
        return false;
    w->ended++;
    w->cancelled += cancelled;
    w->failed += failed;
    if (c->json)
        client_print_json(c, job);
    else if (c->quiet)
        printf("%.0f %s\n", member_number(job, "id", 0.0), state);
    else
        outcome_print(c, job);
    fflush(stdout);
    return true;
}

/* Asks for the jobs that have not ended. STATUS_UNAVAILABLE only once the server has been away for too long. */
static enum status ask_round(struct waiting *w, bool any, struct reply *reply, struct error *err) {
    struct client *c = w->client;
    for (size_t i = 0; i < w->open_count && !(any && w->ended);) {
        enum status status = client_job_get(c, w->open[i], reply, err);
        double patience = c->retry_sec >= 0.0 ? c->retry_sec : w->ever ? PATIENCE_SEC : CLIENT_RETRY_SEC;
        if (status == STATUS_UNAVAILABLE && clock_sec() - w->heard_at < patience) {
            if (!w->told)
                client_note(c, "lost the connection to the server; waiting continues when it is back");
            w->told = true;
            return STATUS_OK;
        }
        if (status != STATUS_OK)
            return status;
        w->heard_at = clock_sec();
        w->ever = true;
        w->told = false;
        tell_paused(w, reply->json);
        if (take(w, reply->json))
            w->open[i] = w->open[--w->open_count];
        else
            i++;
    }
    return STATUS_OK;
}

/* Until all have ended, or the first; *late: the time was over before. */
static enum status wait_for(struct waiting *w, bool any, double timeout_sec, bool *late, struct reply *reply,
                            struct error *err) {
    double begun = clock_sec();
    w->heard_at = begun;
    for (int tries = 0;; tries++) {
        enum status status = ask_round(w, any, reply, err);
        if (status != STATUS_OK || w->open_count == 0 || (any && w->ended))
            return status;
        double left = timeout_sec - (clock_sec() - begun);
        *late = left <= 0.0;
        if (*late)
            return STATUS_OK;
        if (!request_pause(w->client->request, 0, fmin(fmin(0.1 * (tries + 1), ROUND_SEC), left)))
            return STATUS_CANCELLED;
    }
}

static enum status read_jobs(struct waiting *w, const struct options *o, struct reply *reply, struct error *err) {
    w->open = mem_calloc(o->word_count, sizeof *w->open);
    for (size_t i = 0; i < o->word_count; i++) {
        int64_t id;
        size_t at = 0;
        enum status status = client_job_id(w->client, o->word[i], &id, reply, err);
        if (status != STATUS_OK)
            return status;
        while (at < w->open_count && w->open[at] != id)
            at++;
        w->open[at] = id; /* named twice, it is waited for once */
        w->open_count += at == w->open_count;
    }
    return STATUS_OK;
}

int wait_run(struct client *c, const struct options *o) {
    struct waiting w = {.client = c};
    struct reply reply;
    struct error err;
    bool late = false;
    int code = CLIENT_OK;
    double timeout_sec = options_seconds(o, "timeout", (double)INFINITY);
    reply_init(&reply);
    enum status status = read_jobs(&w, o, &reply, &err);
    if (status == STATUS_OK)
        status = wait_for(&w, options_flag(o, "any"), timeout_sec, &late, &reply, &err);
    if (status == STATUS_CANCELLED) /* while it asked, or between */
        error_set(&err, status, "interrupted; the jobs continue");
    if (status != STATUS_OK)
        code = client_fail(c, &reply, &err);
    else if (late)
        client_note(c, "%zu job%s not ended after %.0f s", w.open_count, w.open_count == 1 ? " has" : "s have",
                    timeout_sec);
    mem_free(w.open);
    reply_release(&reply);
    if (code != CLIENT_OK)
        return code;
    return w.failed ? CLIENT_JOB_FAILED : late ? CLIENT_TIME_OVER : w.cancelled ? CLIENT_JOB_CANCELLED : CLIENT_OK;
}
