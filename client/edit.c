/* edit.c -- `edit` and `extend`: change a job's attributes and limits. */
#include <string.h>

#include "client/commands.h"
#include "client/new_job.h"
#include "client/retention.h"

const struct command_option edit_options[] = {
    {"name", 'n', OPTION_TEXT, "NAME", "what people will call the job"},
    {"priority", 'p', OPTION_WHOLE, "N", "-100 to 100, larger goes first"},
    {"label", 'l', OPTION_LIST, "KEY=VALUE", "a label of your own; they replace all that were there"},
    {"share", 0, OPTION_FLAG, NULL, "let every user of the server look at the job and its room"},
    {"unshare", 0, OPTION_FLAG, NULL, "no longer"},
    KEEPING_OPTIONS,
    {"first", 0, OPTION_FLAG, NULL, "before all waiting jobs of its priority"},
    {"last", 0, OPTION_FLAG, NULL, "after all of them"},
    {"before", 0, OPTION_TEXT, "JOB", "before that job, and with its priority"},
    {0},
};
const struct command_option extend_options[] = {
    {"iterations", 'i', OPTION_WHOLE, "N", "so many more, for a job with that limit"},
    {"looks", 0, OPTION_WHOLE, "N", "so many more observations at each part of the texture"},
    {"time", 't', OPTION_SECONDS, "SEC", "so much more working time, for all others"},
    {0},
};

/* Sends the body to /v1/jobs/ID`suffix` and prints the job's new state. */
static int send_change(struct client *c, int64_t id, const char *method, const char *suffix, const cJSON *body) {
    struct reply reply;
    struct error err;
    int code = CLIENT_OK;
    char path[80], kept[40];
    reply_init(&reply);
    snprintf(path, sizeof path, "/v1/jobs/%lld%s", (long long)id, suffix);
    /* If-Match: *: only the named members change, whatever else has changed meanwhile. */
    struct request_call call = {.path = path, .method = method, .body = body, .header = {"If-Match: *"}};
    enum status status = request_run(c->request, &call, &reply, &err);
    if (status != STATUS_OK)
        code = client_fail(c, &reply, &err);
    else if (c->json)
        client_print_json(c, reply.json);
    else if (!c->quiet) {
        retention_sentence(kept, reply.json);
        client_say(c, "job %lld is %s, priority %.0f%s%s: %s", (long long)id, member_text(reply.json, "state"),
                   member_number(reply.json, "priority", 0.0), *kept ? ", " : "", kept,
                   member_text(reply.json, "name"));
    }
    reply_release(&reply);
    return code;
}

static enum status describe_order(struct client *c, const struct options *o, cJSON *body, struct reply *reply,
                                  struct error *err) {
    const char *before = options_text(o, "before", NULL);
    bool first = options_flag(o, "first"), last = options_flag(o, "last");
    int64_t id;
    if ((before != NULL) + first + last > 1)
        return error_set(err, STATUS_INPUT, "--first, --last and --before exclude each other");
    if (before) {
        enum status status = client_job_id(c, before, &id, reply, err);
        if (status != STATUS_OK)
            return status;
        json_add_int(body, "order", id);
    } else if (first || last) {
        json_add_string(body, "order", first ? "first" : "last");
    }
    return STATUS_OK;
}

static enum status describe_edit(struct client *c, const struct options *o, cJSON *body, struct reply *reply,
                                 struct error *err) {
    enum status status = STATUS_OK;
    cJSON *labels = NULL;
    if (options_text(o, "name", NULL))
        json_add_string(body, "name", options_text(o, "name", NULL));
    if (options_text(o, "priority", NULL))
        json_add_int(body, "priority", options_whole(o, "priority", 0));
    if (options_flag(o, "share") && options_flag(o, "unshare"))
        return error_set(err, STATUS_INPUT, "--share and --unshare exclude each other");
    if (options_flag(o, "share") || options_flag(o, "unshare"))
        json_add_bool(body, "shared", options_flag(o, "share"));
    for (size_t i = 0; i < o->given_count && status == STATUS_OK; i++) {
        if (strcmp(o->given[i].option->name, "label") != 0)
            continue;
        if (!labels)
            labels = cJSON_AddObjectToObject(body, "labels");
        status = label_add(labels, o->given[i].text, err);
    }
    if (status == STATUS_OK)
        status = retention_describe(o, body, err);
    if (status == STATUS_OK)
        status = describe_order(c, o, body, reply, err);
    if (status == STATUS_OK && !body->child) {
        error_set(err, STATUS_INPUT, "there is nothing to change");
        status = error_hint(err, "`unbake edit --help` lists what can be changed");
    }
    return status;
}

int edit_run(struct client *c, const struct options *o) {
    struct reply reply;
    struct error err;
    int first = CLIENT_OK;
    cJSON *body = cJSON_CreateObject();
    reply_init(&reply);
    enum status status = describe_edit(c, o, body, &reply, &err);
    if (status != STATUS_OK)
        first = client_fail(c, &reply, &err);
    for (size_t i = 0; i < o->word_count && status == STATUS_OK; i++) {
        int64_t id;
        enum status found = client_job_id(c, o->word[i], &id, &reply, &err);
        int code = found == STATUS_OK ? send_change(c, id, "PATCH", "", body) : client_fail(c, &reply, &err);
        if (first == CLIENT_OK)
            first = code;
    }
    cJSON_Delete(body);
    reply_release(&reply);
    return first;
}

int extend_run(struct client *c, const struct options *o) {
    struct reply reply;
    struct error err;
    int64_t id;
    int code;
    cJSON *body = cJSON_CreateObject();
    const char *time = options_text(o, "time", NULL), *iterations = options_text(o, "iterations", NULL);
    const char *looks = options_text(o, "looks", NULL);
    enum status status = STATUS_OK;
    reply_init(&reply);
    if ((time != NULL) + (iterations != NULL) + (looks != NULL) != 1) {
        error_set(&err, STATUS_INPUT, "extend needs --looks, --iterations or --time");
        status = error_hint(&err, "--iterations or --time where `unbake show %.40s` has such a limit, else --looks",
                            o->word[0]);
    }
    if (status == STATUS_OK)
        status = client_job_id(c, o->word[0], &id, &reply, &err);
    if (looks)
        json_add_int(body, "looks", options_whole(o, "looks", 0));
    if (iterations)
        json_add_int(body, "iterations", options_whole(o, "iterations", 0));
    if (time)
        json_add_number(body, "time_limit_sec", options_seconds(o, "time", 0.0));
    code = status == STATUS_OK ? send_change(c, id, "POST", "/extend", body) : client_fail(c, &reply, &err);
    cJSON_Delete(body);
    reply_release(&reply);
    return code;
}
