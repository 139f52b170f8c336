/* jobs.c -- `list`, `show`, and actions on jobs: cancel, pause, resume, retry, rm. */
#include <math.h>
#include <string.h>

#include "client/commands.h"
#include "client/retention.h"
#include "client/table.h"
#include "client/view.h"
#include "common/mem.h"
#include "common/nearest.h"
#include "common/protocol.h"
#include "common/url.h"

const struct command_option list_options[] = {
    {"state", 's', OPTION_TEXT, "STATE", "only jobs that are queued, running, paused, succeeded, ..."},
    {"kind", 'k', OPTION_TEXT, "KIND", "only jobs of that kind: reconstruct, render or evaluate"},
    {"label", 'l', OPTION_TEXT, "KEY[=VALUE]", "only jobs with that label"},
    {"limit", 'n', OPTION_WHOLE, "N", "at most so many (20); 0: all"},
    FORMAT_OPTION,
    {0},
};

const struct command_option show_options[] = {FORMAT_OPTION, {0}};

const struct command_option retry_options[] = {
    {"from", 0, OPTION_TEXT, "STAGE", "do that stage and all after it anew"},
    {0},
};
const struct command_option rm_options[] = {
    {"dry-run", 0, OPTION_FLAG, NULL, "only say what would be removed"},
    {0},
};

/* Whether the word (NULL: none was given) is one of those; `all` lists them for people. */
static enum status check_word(const char *what, const char *word, const char *const *known, const char *all,
                              struct error *err) {
    struct nearest nearest;
    if (!word)
        return STATUS_OK;
    nearest_init(&nearest, word);
    for (; *known; known++) {
        if (strcmp(*known, word) == 0)
            return STATUS_OK;
        nearest_offer(&nearest, *known);
    }
    error_set(err, STATUS_INPUT, "unknown %s \"%.100s\"", what, word);
    return nearest.best ? error_hint(err, "did you mean %s?", nearest.best) : error_hint(err, "%s", all);
}

/* A finished job counts as 100 %: its last report falls short of that. */
static double percent_done(const cJSON *job) {
    bool succeeded = strcmp(member_text(job, "state"), JOB_STATE_SUCCEEDED) == 0;
    return succeeded ? 100.0 : floor(100.0 * member_number(job, "progress", 0.0));
}

/* "render 17": what is done, and to which job; nothing of reconstructions, which most are. */
static void put_kind(struct table *t, size_t column, const cJSON *job) {
    int64_t source = member_whole(job, "source", 0);
    if (source)
        table_set(t, column, COLOUR_NONE, "%s %lld", member_text(job, "kind"), (long long)source);
}

static const char *stage_of(const cJSON *job) {
    bool waits = strncmp(member_text(job, "reason"), JOB_WAITING_IN, sizeof JOB_WAITING_IN - 1) == 0;
    return waits ? "waiting" : member_text(job, "stage");
}

static void print_jobs(struct client *c, const cJSON *items) {
    static const char *const headings[] = {">job", "state", ">done",     "~stage",  "~>left",
                                           ">age", "?kind", "~>expires", "~?owner", "name"};
    struct table t;
    const cJSON *job;
    table_init(&t, 10, headings);
    cJSON_ArrayForEach(job, items) {
        char age[16], expires[16];
        const char *state = member_text(job, "state");
        bool running = strcmp(state, JOB_STATE_RUNNING) == 0;
        double eta = member_number(job, "eta_sec", -1.0);
        table_row(&t);
        table_set(&t, 0, COLOUR_NONE, "%.0f", member_number(job, "id", 0.0));
        table_set(&t, 1, state_colour(state), "%s", state);
        table_set(&t, 2, COLOUR_NONE, "%.0f%%", percent_done(job));
        table_set(&t, 3, COLOUR_NONE, "%s", running ? stage_of(job) : "");
        if (running && eta >= 0.0) {
            char left[16];
            format_duration(left, eta);
            table_set(&t, 4, COLOUR_NONE, "%s", left);
        }
        format_duration(age, time_since(member_text(job, "created_at")));
        table_set(&t, 5, COLOUR_NONE, "%s", age);
        put_kind(&t, 6, job);
        retention_text(expires, job);
        table_set(&t, 7, COLOUR_NONE, "%s", expires);
        table_set(&t, 8, COLOUR_NONE, "%s", member_text(job, "owner"));
        table_set(&t, 9, COLOUR_NONE, "%s", member_text(job, "name"));
    }
    table_print(&t, &c->out);
    table_release(&t);
}

/* "/v1/jobs?state=failed&label=a%3Db": of each that is not NULL; the caller's. */
static char *list_path(const char *state, const char *kind, const char *label) {
    const char *const names[] = {"state", "kind", "label"}, *const values[] = {state, kind, label};
    struct buf path;
    buf_init(&path, 1 << 20);
    buf_puts(&path, "/v1/jobs");
    char separator = '?';
    for (size_t i = 0; i < 3; i++) {
        if (!values[i])
            continue;
        buf_printf(&path, "%c%s=", separator, names[i]);
        url_encode(&path, values[i], false);
        separator = '&';
    }
    return buf_detach(&path);
}

int list_run(struct client *c, const struct options *o) {
    const char *state = options_text(o, "state", NULL), *kind = options_text(o, "kind", NULL);
    long limit = options_whole(o, "limit", 20);
    struct reply reply;
    struct error err;
    cJSON *items = NULL;
    int code = CLIENT_OK;
    reply_init(&reply);
    enum status status =
        check_word("state", state, command_job_states, "queued, running, paused, succeeded, failed or cancelled", &err);
    if (status == STATUS_OK)
        status = check_word("kind", kind, command_job_kinds, "reconstruct, render or evaluate", &err);
    if (limit < 0)
        status = error_set(&err, STATUS_INPUT, "--limit must be 0 or more, not %ld", limit);
    if (status == STATUS_OK) {
        char *path = list_path(state, kind, options_text(o, "label", NULL));
        status = client_list(c, path, (size_t)limit, &items, &reply, &err);
        mem_free(path);
    }
    if (status != STATUS_OK)
        code = client_fail(c, &reply, &err);
    else if (c->json)
        client_print_json(c, items);
    else if (cJSON_GetArraySize(items) == 0)
        client_note(c, "no jobs%s%s", state ? " are " : "", state ? state : "");
    else if (c->quiet) {
        const cJSON *job;
        cJSON_ArrayForEach(job, items)
            printf("%.0f\n", member_number(job, "id", 0.0));
    } else
        print_jobs(c, items);
    cJSON_Delete(items);
    reply_release(&reply);
    return code;
}

/* --- show ---------------------------------------------------------------------------------- */

/* "texture_size=512 seed=7" */
static void print_members(struct client *c, const char *name, const cJSON *object) {
    struct buf line;
    const cJSON *member;
    buf_init(&line, 1 << 16);
    cJSON_ArrayForEach(member, object) {
        char *text = cJSON_IsString(member) ? mem_strdup(member->valuestring) : json_text(member);
        buf_printf(&line, "%s%s=%s", line.length ? " " : "", member_name(member), text);
        mem_free(text);
    }
    field_print(c, name, buf_text(&line));
    buf_release(&line);
}

static void print_outputs(struct client *c, const cJSON *outputs) {
    static const char *const headings[] = {">size", "output", "sha256"};
    struct table t;
    const cJSON *output;
    if (cJSON_GetArraySize(outputs) == 0)
        return;
    table_init(&t, 3, headings);
    cJSON_ArrayForEach(output, outputs) {
        char size[16];
        format_bytes(size, member_number(output, "bytes", 0.0));
        table_row(&t);
        table_set(&t, 0, COLOUR_NONE, "%s", size);
        table_set(&t, 1, COLOUR_NONE, "%s", member_text(output, "name"));
        table_set(&t, 2, COLOUR_DIM, "%.12s", member_text(output, "sha256"));
    }
    fputs("\n", c->out.out);
    table_print(&t, &c->out);
    table_release(&t);
}

/* The webhook, and the outcome of its last message. */
static void print_webhook(struct client *c, const cJSON *job) {
    const cJSON *d = cJSON_GetObjectItemCaseSensitive(job, "webhook_delivery");
    double status = member_number(d, "last_status", 0.0);
    char text[400], answered[32] = "";
    if (!cJSON_IsObject(d))
        return;
    field_print(c, "webhook", member_text(job, "webhook"));
    if (status > 0.0)
        snprintf(answered, sizeof answered, ", answered %.0f", status);
    snprintf(text, sizeof text, "%s, %.0f to be sent, %.0f attempts%s%s%.200s", member_text(d, "state"),
             member_number(d, "pending", 0.0), member_number(d, "attempts", 0.0), answered,
             *member_text(d, "last_error") ? ": " : "", member_text(d, "last_error"));
    field_print(c, "delivery", text);
}

/* What was sent to the job, and what is still to be. */
static void print_files(struct client *c, const cJSON *files) {
    struct buf line;
    const cJSON *file;
    buf_init(&line, 1 << 16);
    cJSON_ArrayForEach(file, files) {
        double bytes = member_number(file, "bytes", -1.0);
        char size[16] = "to be sent";
        if (bytes >= 0.0)
            format_bytes(size, bytes);
        buf_printf(&line, "%s%s (%s)", line.length ? ", " : "", member_text(file, "name"), size);
    }
    field_print(c, "files", buf_text(&line));
    buf_release(&line);
}

static void print_job(struct client *c, const cJSON *job, const cJSON *outputs) {
    char text[96], left[16];
    const char *wanted = member_text(job, "wanted");
    snprintf(text, sizeof text, "%.0f", member_number(job, "id", 0.0));
    field_print(c, "job", text);
    field_print(c, "name", member_text(job, "name"));
    if (member_whole(job, "source", 0))
        snprintf(text, sizeof text, "%s of job %lld", member_text(job, "kind"),
                 (long long)member_whole(job, "source", 0));
    else
        snprintf(text, sizeof text, "%s", member_text(job, "kind"));
    field_print(c, "kind", text);
    snprintf(text, sizeof text, strcmp(wanted, "run") == 0 ? "%s" : "%s, %s requested", member_text(job, "state"),
             wanted);
    field_print(c, "state", text);
    field_print(c, "reason", member_text(job, "reason"));
    field_print(c, "hint", member_text(job, "hint"));
    if (strcmp(member_text(job, "state"), JOB_STATE_RUNNING) == 0) {
        format_duration(left, member_number(job, "eta_sec", -1.0));
        snprintf(text, sizeof text, "%s, %.0f%%, %s left", member_text(job, "stage"), percent_done(job), left);
        field_print(c, "stage", *member_text(job, "stage") ? text : "");
    }
    const cJSON *parts = cJSON_GetObjectItemCaseSensitive(job, "parts");
    if (cJSON_IsObject(parts)) {
        snprintf(text, sizeof text, "%.0f of %.0f done", member_number(parts, "done", 0.0),
                 member_number(parts, "count", 0.0));
        field_print(c, "parts", text);
    }
    field_print(c, "owner", member_text(job, "owner"));
    print_webhook(c, job);
    field_print(c, "shared", cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(job, "shared")) ? "yes" : "");
    field_print(c, "scene", member_text(job, "scene"));
    snprintf(text, sizeof text, "%.0f", member_number(job, "priority", 0.0));
    field_print(c, "priority", text);
    print_members(c, "labels", cJSON_GetObjectItemCaseSensitive(job, "labels"));
    print_members(c, "settings", cJSON_GetObjectItemCaseSensitive(job, "settings"));
    print_files(c, member_items(job, "files"));
    snprintf(text, sizeof text, "%.0f, %.0f left", member_number(job, "attempt", 0.0),
             member_number(job, "attempts_left", 0.0));
    field_print(c, "attempt", text);
    field_print(c, "created", member_text(job, "created_at"));
    field_print(c, "started", member_text(job, "started_at"));
    field_print(c, "finished", member_text(job, "finished_at"));
    field_print(c, "expires", retention_time(job));
    retention_disk(left, job);
    field_print(c, "on disk", left);
    print_outputs(c, outputs);
}

int show_run(struct client *c, const struct options *o) {
    struct reply job, outputs;
    struct error err;
    int64_t id;
    char path[64];
    int code = CLIENT_OK;
    reply_init(&job);
    reply_init(&outputs);
    struct reply *last = &job;
    enum status status = client_job_id(c, o->word[0], &id, &job, &err);
    if (status == STATUS_OK)
        status = client_job_get(c, id, &job, &err);
    if (status == STATUS_OK) {
        snprintf(path, sizeof path, "/v1/jobs/%lld/outputs", (long long)id);
        last = &outputs;
        status = request_get(c->request, path, &outputs, &err);
    }
    const cJSON *items = member_items(outputs.json, "items");
    if (status != STATUS_OK)
        code = client_fail(c, last, &err);
    else if (c->json) {
        json_add(job.json, "outputs", items ? cJSON_Duplicate(items, true) : cJSON_CreateArray());
        client_print_json(c, job.json);
    } else
        print_job(c, job.json, items);
    reply_release(&job);
    reply_release(&outputs);
    return code;
}

/* --- actions ------------------------------------------------------------------------------- */

/* DELETE of a job; in a dry run, prints what that would do. */
static int remove_job(struct client *c, const char *word, bool dry_run) {
    struct reply reply;
    struct error err;
    int64_t id;
    char path[80], bytes[16];
    int code = CLIENT_OK;
    reply_init(&reply);
    enum status status = client_job_id(c, word, &id, &reply, &err);
    if (status == STATUS_OK) {
        snprintf(path, sizeof path, "/v1/jobs/%lld%s", (long long)id, dry_run ? "?dry_run=1" : "");
        struct request_call call = {.path = path, .method = "DELETE"};
        status = request_run(c->request, &call, &reply, &err);
    }
    if (status != STATUS_OK) {
        code = client_fail(c, &reply, &err);
    } else if (c->json) {
        cJSON *value = dry_run ? cJSON_Duplicate(reply.json, true) : cJSON_CreateObject();
        json_add_int(value, "id", id);
        json_add_bool(value, "removed", !dry_run);
        client_print_json(c, value);
        cJSON_Delete(value);
    } else if (dry_run) {
        format_bytes(bytes, member_number(reply.json, "bytes", 0.0));
        printf("job %lld: %.0f files, %s\n", (long long)id, member_number(reply.json, "files", 0.0), bytes);
    } else if (!c->quiet) {
        printf("job %lld removed\n", (long long)id);
    }
    reply_release(&reply);
    return code;
}

/* POST /v1/jobs/ID/ACTION. */
static int act_on(struct client *c, const char *word, const char *action) {
    struct reply reply;
    struct error err;
    int64_t id;
    char path[80];
    int code = CLIENT_OK;
    reply_init(&reply);
    enum status status = client_job_id(c, word, &id, &reply, &err);
    if (status == STATUS_OK) {
        snprintf(path, sizeof path, "/v1/jobs/%lld/%.40s", (long long)id, action);
        struct request_call call = {.path = path, .method = "POST"};
        status = request_run(c->request, &call, &reply, &err);
    }
    const char *state = member_text(reply.json, "state"), *wanted = member_text(reply.json, "wanted");
    if (status != STATUS_OK)
        code = client_fail(c, &reply, &err);
    else if (c->json)
        client_print_json(c, reply.json);
    else if (!c->quiet)
        client_say(c, strcmp(wanted, "run") == 0 ? "job %lld is %s" : "job %lld is %s, %s requested", (long long)id,
                   state, wanted);
    reply_release(&reply);
    return code;
}

/* Acts on all jobs, also after a failure; the first failure is the exit status. Without an action, removes them. */
static int act_on_all(struct client *c, const struct options *o, const char *action) {
    int first = CLIENT_OK;
    for (size_t i = 0; i < o->word_count; i++) {
        int code = action ? act_on(c, o->word[i], action) : remove_job(c, o->word[i], options_flag(o, "dry-run"));
        if (first == CLIENT_OK)
            first = code;
        if (code == CLIENT_UNREACHABLE || code == CLIENT_INTERRUPTED)
            break;
    }
    return first;
}

int cancel_run(struct client *c, const struct options *o) { return act_on_all(c, o, "cancel"); }

int pause_run(struct client *c, const struct options *o) { return act_on_all(c, o, "pause"); }

int redeliver_run(struct client *c, const struct options *o) { return act_on_all(c, o, "webhook/redeliver"); }

int resume_run(struct client *c, const struct options *o) { return act_on_all(c, o, "resume"); }

int retry_run(struct client *c, const struct options *o) {
    const char *from = options_text(o, "from", NULL);
    struct buf action;
    buf_init(&action, 4096);
    buf_puts(&action, "retry");
    if (from) {
        buf_puts(&action, "?from=");
        url_encode(&action, from, false);
    }
    int code = act_on_all(c, o, buf_text(&action));
    buf_release(&action);
    return code;
}

int rm_run(struct client *c, const struct options *o) { return act_on_all(c, o, NULL); }
