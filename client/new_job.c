/* new_job.c -- see new_job.h. */
#include "client/new_job.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/mem.h"
#include "common/random_hex.h"

#define KEY_DIGITS 32 /* 128 bits: no two submissions of anybody draw the same */

enum status label_add(cJSON *labels, const char *text, struct error *err) {
    const char *equals = strchr(text, '=');
    if (!equals || equals == text)
        return error_set(err, STATUS_INPUT, "label \"%.100s\" is not of the form key=value", text);
    char *key = mem_strndup(text, (size_t)(equals - text));
    enum status status = STATUS_OK;
    if (cJSON_GetObjectItemCaseSensitive(labels, key))
        status = error_set(err, STATUS_INPUT, "label %s is given twice", key);
    else
        json_add_string(labels, key, equals + 1);
    mem_free(key);
    return status;
}

enum status new_job_describe(cJSON *job, const struct options *o,
                             enum status (*parse)(const char *text, cJSON *settings, struct error *err),
                             struct error *err) {
    enum status status = STATUS_OK;
    cJSON *settings = cJSON_CreateObject(), *labels = cJSON_CreateObject();
    for (size_t i = 0; i < o->given_count && status == STATUS_OK; i++) {
        const struct options_given *given = &o->given[i];
        if (strcmp(given->option->name, "set") == 0)
            status = parse(given->text, settings, err);
        else if (strcmp(given->option->name, "label") == 0)
            status = label_add(labels, given->text, err);
    }
    json_add(job, "settings", settings);
    json_add(job, "labels", labels);
    if (options_flag(o, "share"))
        json_add_bool(job, "shared", true);
    json_add_int(job, "priority", options_whole(o, "priority", 0));
    const char *name = options_text(o, "name", NULL), *url = options_text(o, "webhook", NULL);
    const char *secret = getenv("UNBAKE_WEBHOOK_SECRET"); /* a command line is for all to read */
    if (name)
        json_add_string(job, "name", name);
    if (url && !(secret && *secret) && status == STATUS_OK) {
        error_set(err, STATUS_INPUT, "--webhook needs a secret to sign its messages with");
        status = error_hint(err, "put 16 characters or more into UNBAKE_WEBHOOK_SECRET");
    } else if (url && status == STATUS_OK) {
        cJSON *webhook = cJSON_AddObjectToObject(job, "webhook");
        json_add_string(webhook, "url", url);
        json_add_string(webhook, "secret", secret);
    }
    return status;
}

enum status new_job_queue(struct client *c, const cJSON *job, struct reply *reply, struct error *err) {
    char key[KEY_DIGITS + 1], header[64];
    if (random_hex(key, KEY_DIGITS, err) != STATUS_OK)
        return err->status;
    snprintf(header, sizeof header, "Idempotency-Key: %s", key);
    struct request_call call = {
        .method = "POST", .path = "/v1/jobs", .header = {header}, .body = job, .same_twice = true};
    return request_run(c->request, &call, reply, err);
}
