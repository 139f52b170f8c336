/* watch.c -- `watch` and `logs`: a job's events, as they come.
 *
 * The stream is asked for again, from the last event seen, whenever it breaks off: when the
 * daemon restarts, when a proxy has enough, when nothing (not even the keep-alive) comes for
 * SILENCE_SEC. The end of the job, not the end of a stream, ends the watching; what GET says
 * about the job then is its outcome. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "client/commands.h"
#include "client/meter.h"
#include "client/outcome.h"
#include "client/sse.h"
#include "client/view.h"
#include "common/clock.h"
#include "common/mem.h"
#include "common/protocol.h"

#define SILENCE_SEC 45.0 /* three keep-alives */
#define PATIENCE_SEC                                                                                                   \
    600.0              /* for which a stream that has once been open is tried again, unless --retry says otherwise */
#define REDRAW_SEC 0.2 /* between two drawings of the line */
#define PLAIN_SEC 10.0 /* between two lines where none can be redrawn */

const struct command_option watch_options[] = {
    {"all", 'a', OPTION_FLAG, NULL, "begin with what happened before, not with the present"},
    {"exec", 0, OPTION_TEXT, "CMD", "when the job has ended, run that by sh with $UNBAKE_JOB and $UNBAKE_STATE"},
    {0},
};
const struct command_option logs_options[] = {
    {"follow", 'f', OPTION_FLAG, NULL, "print the log's events until the job ends"},
    {0},
};

struct watch {
    struct client *client;
    struct client_view view;
    struct sse sse;
    bool only_log;      /* `logs` */
    bool only_past;     /* ends after the stored events: `logs` without --follow */
    bool from_first;    /* begins with what happened before: not with how the job is now, a stream's first event */
    bool printed;       /* a line of the log was printed */
    bool connected;     /* something arrived over the current connection */
    double heard_at;    /* when the last event came */
    double progress_at; /* when the last progress came */
    double shown_at;
    char shown_state[80]; /* state and stage of the last plain line */
};

/* --- showing ------------------------------------------------------------------------------- */

static void show_line(struct watch *w) {
    struct terminal *t = &w->client->out;
    struct buf line;
    buf_init(&line, 4096);
    double age = w->progress_at > 0.0 ? clock_sec() - w->progress_at : 0.0;
    view_line(&w->view, t, t->live ? terminal_width(t) - 1 : 1000, t->live, age, &line);
    if (t->live)
        terminal_draw(t, buf_text(&line));
    else {
        fprintf(t->out, "%s\n", buf_text(&line));
        fflush(t->out);
    }
    w->shown_at = clock_sec();
    buf_release(&line);
}

/* On a terminal, redraws at a fixed rate. Otherwise prints changes at once, and numbers now and then. */
static void show(struct watch *w, bool urgent) {
    struct client *c = w->client;
    if (c->json || c->quiet || w->only_log || !w->view.state[0] || view_is_over(&w->view))
        return; /* the outcome gets lines of its own */
    double since = clock_sec() - w->shown_at;
    if (c->out.live) {
        if (urgent || since >= REDRAW_SEC)
            show_line(w);
        return;
    }
    char state[sizeof w->shown_state];
    snprintf(state, sizeof state, "%s %s %s", w->view.state, w->view.stage, w->view.wanted);
    bool changed = strcmp(state, w->shown_state) != 0;
    memcpy(w->shown_state, state, sizeof state);
    bool moves = strcmp(w->view.state, JOB_STATE_RUNNING) == 0;
    if (changed || (moves && since >= PLAIN_SEC && !urgent))
        show_line(w);
}

static void print_log(struct watch *w, const cJSON *data) {
    struct client *c = w->client;
    const char *level = member_text(data, "level");
    w->printed = true;
    bool important = strcmp(level, "warning") == 0 || strcmp(level, "error") == 0;
    if (!w->only_log && (c->quiet || !important))
        return;
    struct buf line;
    buf_init(&line, 1 << 20);
    if (w->only_log) {
        terminal_clean(&line, member_text(data, "at"));
        buf_puts(&line, " ");
    }
    enum colour colour = !important ? COLOUR_NONE : strcmp(level, "error") == 0 ? COLOUR_RED : COLOUR_YELLOW;
    buf_puts(&line, terminal_colour(&c->out, colour));
    terminal_clean(&line, level);
    buf_puts(&line, terminal_colour(&c->out, COLOUR_NONE));
    buf_puts(&line, ": ");
    terminal_clean(&line, member_text(data, "message"));
    terminal_clear(&c->out);
    fprintf(c->out.out, "%s\n", buf_text(&line));
    fflush(c->out.out);
    buf_release(&line);
}

/* {"id": 12, "event": "metric", "data": {...}}, the daemon's NDJSON format. */
static void print_event(struct client *c, const char *type, const cJSON *data, const char *id) {
    cJSON *event = cJSON_CreateObject();
    json_add_int(event, "id", strtoll(id, NULL, 10));
    json_add_string(event, "event", type);
    json_add(event, "data", cJSON_Duplicate(data, true));
    client_print_json(c, event);
    cJSON_Delete(event);
}

static bool on_event(void *user, const char *type, const char *data, const char *id) {
    struct watch *w = user;
    cJSON *value;
    w->connected = true;
    w->heard_at = clock_sec();
    if (json_parse(data, strlen(data), "event", &value, NULL) != STATUS_OK)
        return true; /* one malformed event does not end the watching */
    bool is_snapshot = cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(value, "snapshot"));
    if (!w->from_first || !is_snapshot)
        view_event(&w->view, type, value);
    if (strcmp(type, EVENT_PROGRESS) == 0)
        w->progress_at = w->heard_at;
    bool is_log = strcmp(type, EVENT_LOG) == 0;
    if (w->client->json && (is_log || !w->only_log))
        print_event(w->client, type, value, id);
    else if (!w->client->json && is_log)
        print_log(w, value);
    show(w, strcmp(type, EVENT_STATE) == 0);
    cJSON_Delete(value);
    return true;
}

/* --- the stream ---------------------------------------------------------------------------- */

static bool on_bytes(void *user, const struct reply *reply, const char *bytes, size_t length) {
    (void)reply;
    return sse_feed(&((struct watch *)user)->sse, bytes, length);
}

static void on_tick(void *user, double sent) {
    (void)sent;
    show(user, false);
}

static enum status follow_once(struct watch *w, struct reply *reply, struct error *err) {
    char path[64], last[SSE_ID_MAX + 20] = "";
    snprintf(path, sizeof path, "/v1/jobs/%lld/events%s", (long long)w->view.job, w->only_past ? "?follow=0" : "");
    if (w->sse.last_id[0])
        snprintf(last, sizeof last, "Last-Event-ID: %s", w->sse.last_id);
    struct request_call call = {
        .path = path,
        .header = {"Accept: " MIME_SSE, last[0] ? last : NULL},
        .sink = on_bytes,
        .tick = on_tick,
        .user = w,
        .silence_sec = SILENCE_SEC,
        .once = true,
    };
    sse_restart(&w->sse);
    w->connected = false;
    return request_run(w->client->request, &call, reply, err);
}

/* Follows the stream until the job (or only_past: the stored events) has ended. */
static enum status follow(struct watch *w, struct reply *reply, struct error *err) {
    struct client *c = w->client;
    bool ever = false, told = false;
    w->heard_at = clock_sec();
    for (int tries = 0;; tries++) {
        enum status status = follow_once(w, reply, err);
        if (status != STATUS_OK && status != STATUS_UNAVAILABLE)
            return status;
        if (reply->code == 204 || view_is_over(&w->view) || (w->only_past && status == STATUS_OK))
            return STATUS_OK;
        if (w->connected) {
            ever = true;
            told = false;
            tries = 0;
        }
        double patience = c->retry_sec >= 0.0 ? c->retry_sec : ever ? PATIENCE_SEC : CLIENT_RETRY_SEC;
        if (status == STATUS_OK)
            error_set(err, STATUS_UNAVAILABLE, "%s ended the stream of events before the job ended",
                      request_server(c->request));
        if (clock_sec() - w->heard_at > patience)
            return STATUS_UNAVAILABLE;
        if (ever && !told && status != STATUS_OK) {
            client_note(c, "lost the connection to the server; watching continues when it is back");
            told = true;
        }
        if (!request_pause(c->request, tries, reply->retry_after_sec))
            return error_set(err, STATUS_CANCELLED, "interrupted");
    }
}

/* --- the end ------------------------------------------------------------------------------- */

static int interrupted(struct client *c, int64_t job) {
    struct error err;
    error_set(&err, STATUS_CANCELLED, "interrupted; job %lld continues", (long long)job);
    error_hint(&err, "`unbake watch %lld` follows it again, `unbake cancel %lld` ends it", (long long)job,
               (long long)job);
    terminal_keep(&c->out);
    return client_fail(c, NULL, &err);
}

/* `all`: from the job's first event on, else from now on. Uses only_log and only_past of *w. */
static int watch_events(struct watch *w, struct client *c, int64_t job, bool all) {
    struct reply reply;
    struct error err;
    int code = CLIENT_OK;
    w->client = c;
    w->from_first = all;
    view_init(&w->view, job);
    sse_init(&w->sse, on_event, w);
    reply_init(&reply);
    if (all)
        snprintf(w->sse.last_id, sizeof w->sse.last_id, "0");
    enum status status = follow(w, &reply, &err);
    if (status == STATUS_OK && !w->only_log) {
        status = client_job_get(c, job, &reply, &err);
        if (status == STATUS_OK && !c->json && !c->quiet)
            outcome_print(c, reply.json);
        if (status == STATUS_OK && strcmp(member_text(reply.json, "state"), JOB_STATE_SUCCEEDED) != 0)
            code = CLIENT_JOB_FAILED;
    }
    if (status == STATUS_CANCELLED)
        code = interrupted(c, job);
    else if (status != STATUS_OK)
        code = client_fail(c, &reply, &err);
    sse_release(&w->sse);
    reply_release(&reply);
    return code;
}

int watch_job(struct client *c, int64_t job, bool all) { return watch_events(&(struct watch){0}, c, job, all); }

int watch_run(struct client *c, const struct options *o) {
    struct reply reply;
    struct error err;
    int64_t job;
    reply_init(&reply);
    enum status status = client_job_id(c, o->word[0], &job, &reply, &err);
    int code = status == STATUS_OK ? CLIENT_OK : client_fail(c, &reply, &err);
    reply_release(&reply);
    const char *command = options_text(o, "exec", NULL);
    if (code != CLIENT_OK)
        return code;
    code = watch_job(c, job, options_flag(o, "all"));
    if (command && (code == CLIENT_OK || code == CLIENT_JOB_FAILED))
        code = outcome_run_command(c, job, command, code);
    return code;
}

/* --- logs ---------------------------------------------------------------------------------- */

/* The standard error of the job's processes: usually empty; the last words of those that crashed. */
static enum status print_stderr(struct client *c, int64_t job, struct reply *reply, struct error *err) {
    char path[80];
    snprintf(path, sizeof path, "/v1/jobs/%lld/log?bytes=1048576", (long long)job);
    enum status status = request_run(c->request, &(struct request_call){.path = path}, reply, err);
    const char *text = buf_text(&reply->body);
    if (status != STATUS_OK || !*text)
        return status;
    if (c->json) {
        cJSON *data = cJSON_CreateObject();
        json_add_string(data, "text", text);
        print_event(c, "stderr", data, "0");
        cJSON_Delete(data);
        return STATUS_OK;
    }
    fprintf(c->out.out, "%s--- standard error of its processes:%s\n", terminal_colour(&c->out, COLOUR_DIM),
            terminal_colour(&c->out, COLOUR_NONE));
    for (const char *at = text; *at;) {
        struct buf line;
        size_t length = strcspn(at, "\n");
        char *raw = mem_strndup(at, length);
        buf_init(&line, 1 << 21);
        terminal_clean(&line, raw);
        fprintf(c->out.out, "%s\n", buf_text(&line));
        buf_release(&line);
        mem_free(raw);
        at += length + (at[length] == '\n');
    }
    return STATUS_OK;
}

int logs_run(struct client *c, const struct options *o) {
    struct watch w = {.only_log = true, .only_past = !options_flag(o, "follow")};
    struct reply reply;
    struct error err;
    int64_t job;
    reply_init(&reply);
    enum status status = client_job_id(c, o->word[0], &job, &reply, &err);
    int code = status == STATUS_OK ? watch_events(&w, c, job, true) : client_fail(c, &reply, &err);
    if (code == CLIENT_OK && print_stderr(c, job, &reply, &err) != STATUS_OK)
        code = client_fail(c, &reply, &err);
    else if (code == CLIENT_OK && !w.printed && !*buf_text(&reply.body))
        client_note(c, "the log of job %lld is empty", (long long)job);
    reply_release(&reply);
    return code;
}
