/* job_request.c -- see job_request.h. */
#include "server/http/jobs/job_request.h"

#include <limits.h>
#include <math.h>
#include <string.h>

#include "common/base64.h"
#include "common/mem.h"
#include "common/protocol.h"
#include "common/url.h"
#include "common/utf8.h"
#include "server/http/api.h"
#include "server/http/retention.h"
#include "server/job/scene_fit.h"
#include "server/transport/body.h"
#include "server/transport/problem.h"

#define PRIORITY_MAX 100      /* either way */
#define LABELS_MAX 32         /* of a job */
#define WEBHOOK_SECRET_MIN 16 /* bytes, both */
#define WEBHOOK_SECRET_MAX 200

void job_request_release(struct job_request *w) {
    cJSON_Delete(w->body);
    mem_free(w->labels);
}

static bool check_string(const cJSON *member, size_t max, cJSON *params) {
    if (cJSON_IsString(member) && *member->valuestring && strlen(member->valuestring) <= max &&
        utf8_is_name(member->valuestring))
        return true;
    problem_param(params, member->string, NULL, "must be text of 1 to %zu bytes without control characters", max);
    return false;
}

static void read_labels(struct job_request *w, const cJSON *member, cJSON *params) {
    size_t count = 0;
    bool good = cJSON_IsObject(member);
    for (const cJSON *label = good ? member->child : NULL; label; label = label->next, count++)
        good = good && cJSON_IsString(label) && strlen(label->valuestring) <= API_LABEL_MAX_BYTES && *label->string &&
               strlen(label->string) <= API_LABEL_MAX_BYTES && utf8_is_name(label->string) &&
               utf8_is_name(label->valuestring);
    if (good && count <= LABELS_MAX)
        w->labels = json_text(member);
    else
        problem_param(params, "labels", NULL,
                      "must be an object of at most %d texts, each name and "
                      "text of at most %d bytes without control characters",
                      LABELS_MAX, API_LABEL_MAX_BYTES);
}

static void read_priority(struct job_request *w, const cJSON *member, cJSON *params) {
    double value = cJSON_IsNumber(member) ? member->valuedouble : NAN;
    if (fabs(value) <= PRIORITY_MAX && value == floor(value))
        w->priority = (int)value;
    else
        problem_param(params, "priority", NULL, "must be a whole number from %d to %d", -PRIORITY_MAX, PRIORITY_MAX);
}

static bool is_key(const char *base64) {
    unsigned char key[WEBHOOK_KEY_MAX];
    size_t size;
    return base64_decode(base64, strlen(base64), key, sizeof key, &size) && size >= WEBHOOK_KEY_MIN;
}

/* {"url", "secret"}: both, and nothing else. */
static void read_webhook(struct job_request *w, const cJSON *member, cJSON *params) {
    const char *url = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(member, "url"));
    const char *secret = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(member, "secret"));
    struct url parts;
    struct error err;
    size_t length = secret ? strlen(secret) : 0;
    if (!url || !secret || cJSON_GetArraySize(member) != 2)
        problem_param(params, "webhook", "the secret signs the messages, and so tells them from others'",
                      "must be an object of two texts, url and secret");
    else if (length < WEBHOOK_SECRET_MIN || length > WEBHOOK_SECRET_MAX)
        problem_param(params, "webhook", NULL, "must have a secret of %d to %d bytes", WEBHOOK_SECRET_MIN,
                      WEBHOOK_SECRET_MAX);
    else if (strncmp(secret, WEBHOOK_SECRET_PREFIX, strlen(WEBHOOK_SECRET_PREFIX)) == 0 &&
             !is_key(secret + strlen(WEBHOOK_SECRET_PREFIX)))
        problem_param(params, "webhook", "printf 'whsec_%s' \"$(head -c 32 /dev/urandom | base64)\" makes one",
                      "has a secret that begins with " WEBHOOK_SECRET_PREFIX
                      ", but what follows is not the base64 of %d to %d bytes",
                      WEBHOOK_KEY_MIN, WEBHOOK_KEY_MAX);
    else if (url_parse(url, &parts, &err) != STATUS_OK)
        problem_param(params, "webhook", NULL, "%s", err.message);
    w->webhook_url = url;
    w->webhook_secret = secret;
}

/* "first", "last" or the number of a job. */
static void read_order(struct job_request *w, const cJSON *member, cJSON *params) {
    double before = cJSON_IsNumber(member) ? member->valuedouble : 0.0;
    const char *word = cJSON_IsString(member) ? member->valuestring : "";
    w->place = JOB_PLACE_KEEP;
    if (strcmp(word, "first") == 0)
        w->place = JOB_PLACE_FIRST;
    else if (strcmp(word, "last") == 0)
        w->place = JOB_PLACE_LAST;
    else if (before >= 1 && before < 9e15 && before == floor(before))
        w->place = JOB_PLACE_BEFORE;
    else
        problem_param(params, "order", NULL, "must be \"first\", \"last\" or the number of the job to go before");
    w->before = (int64_t)before;
}

static void read_kind(struct job_request *w, cJSON *params) {
    const cJSON *member = cJSON_GetObjectItemCaseSensitive(w->body, "kind");
    if (member && !(cJSON_IsString(member) && job_kind_parse(member->valuestring, &w->kind)))
        problem_param(params, "kind", NULL,
                      "must be " JOB_KIND_RECONSTRUCT ", " JOB_KIND_RENDER " or " JOB_KIND_EVALUATE);
}

static void read_source(struct job_request *w, const cJSON *member, cJSON *params) {
    double id = cJSON_IsNumber(member) ? member->valuedouble : 0.0;
    if (w->kind == JOB_RECONSTRUCT)
        problem_param(params, "source", "kind says what a job is to do", "is for renders and evaluations");
    else if (id >= 1.0 && id < 9e15 && id == floor(id))
        w->source = (int64_t)id;
    else
        problem_param(params, "source", NULL, "must be the number of a reconstruction");
}

static void read_scene(struct job_request *w, const cJSON *member, cJSON *params) {
    if (w->kind == JOB_RENDER)
        problem_param(params, "scene", "source names the reconstruction that a render reads", "is not for renders");
    else
        w->scene = check_string(member, SCENE_ID_SIZE - 1, params) ? member->valuestring : NULL;
}

/* What a new job cannot do without. */
static void check_missing(const struct job_request *w, cJSON *params) {
    if (w->kind == JOB_RECONSTRUCT && !cJSON_HasObjectItem(w->body, "scene"))
        problem_param(params, "scene", "POST the bundle to /v1/scenes; its reply has the id", "is missing");
    if (w->kind != JOB_RECONSTRUCT && !cJSON_HasObjectItem(w->body, "source"))
        problem_param(params, "source", "it is the number of the reconstruction that is read", "is missing");
}

struct response *job_request_read(const struct request *r, struct job_request *w, bool is_new, cJSON *params) {
    memset(w, 0, sizeof *w);
    w->priority = INT_MIN;
    w->shared = -1;
    struct response *refusal = NULL;
    w->body = body_object(r, &refusal);
    if (!w->body)
        return refusal;
    if (is_new)
        read_kind(w, params);
    for (const cJSON *member = w->body->child; member; member = member->next) {
        const char *name = member->string;
        if (strcmp(name, "name") == 0)
            w->name = check_string(member, API_NAME_MAX_BYTES, params) ? member->valuestring : NULL;
        else if (strcmp(name, "labels") == 0)
            read_labels(w, member, params);
        else if (strcmp(name, "priority") == 0)
            read_priority(w, member, params);
        else if (strcmp(name, "shared") == 0 && cJSON_IsBool(member))
            w->shared = cJSON_IsTrue(member);
        else if (strcmp(name, "shared") == 0)
            problem_param(params, name, NULL, "must be true or false");
        else if (!is_new && strcmp(name, "order") == 0)
            read_order(w, member, params);
        else if (!is_new && retention_read(&w->retention, member, params))
            continue;
        else if (is_new && strcmp(name, "kind") == 0)
            continue;
        else if (is_new && strcmp(name, "scene") == 0)
            read_scene(w, member, params);
        else if (is_new && strcmp(name, "source") == 0)
            read_source(w, member, params);
        else if (is_new && strcmp(name, "webhook") == 0)
            read_webhook(w, member, params);
        else if (is_new && strcmp(name, "settings") == 0)
            w->settings = member;
        else
            problem_param(params, name,
                          is_new ? "known: kind, scene, source, name, settings, priority, labels, webhook, shared"
                                 : "known: name, priority, labels, shared, order, pinned, "
                                   "expires_at",
                          "is unknown");
    }
    if (is_new)
        check_missing(w, params);
    return NULL;
}

void job_request_faults(const cJSON *problems, cJSON *params) {
    const cJSON *problem;
    cJSON_ArrayForEach(problem, problems) {
        const char *name = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(problem, "name"));
        const char *reason = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(problem, "reason"));
        const char *hint = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(problem, "hint"));
        char *full = strcmp(name, "settings") == 0 ? mem_strdup(name) : mem_printf("settings.%s", name);
        problem_param(params, full, hint, "%s", reason);
        mem_free(full);
    }
}

void job_request_settings(const struct job_request *w, struct settings *settings, cJSON *params) {
    cJSON *problems = cJSON_CreateArray();
    if (w->settings && settings_apply(settings, w->settings, problems, NULL) != STATUS_OK)
        job_request_faults(problems, params);
    cJSON_Delete(problems);
}

void job_request_executor(const char *chosen, const char *names, cJSON *params) {
    const char *at = names ? names : "";
    size_t length = strlen(chosen);
    while (length > 0 && *(at += strspn(at, " ,\t"))) {
        size_t each = strcspn(at, " ,\t");
        if (each == length && strncmp(at, chosen, length) == 0)
            return;
        at += each;
    }
    if (length > 0 && names)
        problem_param(params, "settings.executor", NULL, "must be one of: %s", names);
}

struct response *job_request_fit(const struct request *r, const struct scene_row *scene,
                                 const struct settings *settings) {
    struct error err;
    cJSON *remedy;
    if (settings_is(settings, "fit", "ignore") || scene_fit_check(scene, &remedy, &err) == STATUS_OK)
        return NULL;
    cJSON *members = cJSON_CreateObject();
    json_add(members, "remedy", remedy ? remedy : cJSON_CreateNull());
    return problem_full(r, problem_status(err.status), err.message, err.hint, members);
}
