/* extension.c -- see extension.h. */
#include "server/http/extension.h"

#include <math.h>
#include <string.h>

#include "common/json.h"
#include "common/settings.h"
#include "server/transport/problem.h"

/* The job's settings: *given as they were submitted (the caller's), *full with defaults filled in. */
static enum status read_settings(const struct job *job, cJSON **given, struct settings *full, struct error *err) {
    enum status status = json_parse(job->settings, strlen(job->settings), "the text of its settings", given, err);
    if (status == STATUS_OK)
        status = settings_apply(full, *given, NULL, err);
    if (status == STATUS_OK)
        return status;
    error_prefix(err, "job %lld", (long long)job->id);
    return err->status = STATUS_CORRUPT; /* they were valid when the job was submitted */
}

/* The setting behind a limit that a request names; NULL where it does not limit this job. A job that is limited by
 * iterations is limited by nothing else; other jobs are limited by observations a texel, by time, or by both. */
static const char *limit_setting(const struct settings *full, const char *name) {
    const char *looks = settings_is(full, "method", "solve") ? "refine_looks" : "listing1_looks";
    bool by_iterations = settings_number(full, "iterations") > 0.0;
    if (strcmp(name, "iterations") == 0)
        return by_iterations ? "iterations" : NULL;
    if (strcmp(name, "looks") == 0)
        return !by_iterations && settings_number(full, looks) > 0.0 ? looks : NULL;
    if (strcmp(name, "time_limit_sec") == 0)
        return !by_iterations && settings_number(full, name) > 0.0 ? "time_limit_sec" : NULL;
    return NULL;
}

/* Raises in `settings` the limit that the body names; problems go to params. With more time, the limit by observations
 * is dropped: the job may have ended by it before its time was up. */
static void raise_limit(cJSON *settings, struct settings *full, const cJSON *body, cJSON *params) {
    static const char *const names[] = {"iterations", "time_limit_sec", "looks"};
    const char *limit = limit_setting(full, body->string), *right = NULL;
    double more = cJSON_IsNumber(body) ? body->valuedouble : -1.0;
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        right = !right && limit_setting(full, names[i]) ? names[i] : right;
    if (!limit) {
        problem_param(params, body->string, NULL, "is not what limits this job: %s is", right);
        return;
    }
    double sum = settings_number(full, limit) + more;
    if (!(more > 0.0) || sum <= settings_number(full, limit)) { /* or lost to rounding */
        problem_param(params, body->string, NULL, "must be a number above 0");
        return;
    }
    if (strcmp(limit, "time_limit_sec") != 0 && more != floor(more)) {
        problem_param(params, body->string, NULL, "must be a whole number");
        return;
    }
    cJSON_DeleteItemFromObjectCaseSensitive(settings, limit);
    json_add_number(settings, limit, sum);
    if (strcmp(limit, "time_limit_sec") == 0) {
        cJSON_DeleteItemFromObjectCaseSensitive(settings, "refine_looks");
        if (settings_is(full, "method", "solve"))
            json_add_number(settings, "refine_looks", 0);
    }
    settings_apply(full, settings, params, NULL);
}

char *extension_settings(const struct request *r, const struct job *job, struct response **refusal) {
    struct error err;
    cJSON *body = NULL, *settings = NULL, *params = cJSON_CreateArray();
    struct settings full;
    char *text = NULL;
    settings_init(&full);
    if (json_parse(buf_text(&r->body), r->body.length, "the request body", &body, &err) != STATUS_OK) {
        *refusal = problem(r, 400, "%s", err.message);
    } else if (!cJSON_IsObject(body) || cJSON_GetArraySize(body) != 1) {
        *refusal =
            problem(r, 400, "the request body is not {\"looks\": N}, {\"iterations\": N} or {\"time_limit_sec\": SEC}");
    } else if (read_settings(job, &settings, &full, &err) != STATUS_OK) {
        *refusal = problem_from(r, &err);
    } else {
        raise_limit(settings, &full, body->child, params);
        if (cJSON_GetArraySize(params) > 0) {
            *refusal = problem_invalid(r, "the extension is invalid", params);
            params = NULL;
        } else {
            text = json_text(settings);
        }
    }
    settings_release(&full);
    cJSON_Delete(params);
    cJSON_Delete(settings);
    cJSON_Delete(body);
    return text;
}
