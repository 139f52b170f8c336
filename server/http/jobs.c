/* jobs.c -- /v1/jobs: list, submit, show, change, delete. */
#include <limits.h>
#include <stdio.h>
#include <string.h>

#include "common/mem.h"
#include "common/settings.h"
#include "common/sha256.h"
#include "server/data/layout.h"
#include "server/data/trash.h"
#include "server/http/auth.h"
#include "server/http/handlers.h"
#include "server/http/job_reply.h"
#include "server/http/job_request.h"
#include "server/http/retention.h"
#include "server/http/space.h"
#include "server/http/views.h"
#include "server/net/field.h"
#include "server/transport/problem.h"

struct response *jobs_get(struct api *api, struct request *r) {
    struct response *refusal = NULL;
    struct job job;
    if (!auth_job(api, r, ACCESS_READ, &job, &refusal))
        return refusal;
    struct response *reply = target_query(&r->target, "wait") ? events_wait(api, r, &job) : NULL;
    if (!reply)
        return job_reply(r, &job, 200);
    job_release(&job);
    return reply;
}

struct response *jobs_list(struct api *api, struct request *r) {
    struct response *refusal = NULL;
    const char *state_name = target_query(&r->target, "state");
    const char *cursor = target_query(&r->target, "cursor");
    enum job_state state = JOB_QUEUED;
    int64_t before = 0;
    if (state_name && !job_state_parse(state_name, &state))
        return problem_full(r, 400, "unknown state", "known: queued, running, paused, succeeded, failed, cancelled",
                            NULL);
    if (cursor && !field_number(cursor, 1, INT64_MAX, &before))
        return problem(r, 400, "invalid cursor");
    size_t limit = view_limit(r, &refusal), count = 0;
    if (refusal)
        return refusal;
    struct job *jobs = mem_calloc(limit + 1, sizeof *jobs);
    struct error err;
    /* One row more than asked for shows that there is another page. */
    if (store_job_list(api->store, &r->caller, state_name ? (int)state : -1, before, limit + 1, jobs, &count, &err) !=
        STATUS_OK) {
        mem_free(jobs);
        return problem_from(r, &err);
    }
    cJSON *items = cJSON_CreateArray();
    char next[32] = "";
    for (size_t i = 0; i < count; i++) {
        if (i < limit)
            cJSON_AddItemToArray(items, view_job(&jobs[i], &r->caller));
        if (i == limit)
            snprintf(next, sizeof next, "%lld", (long long)jobs[limit - 1].id);
    }
    for (size_t i = 0; i < count; i++)
        job_release(&jobs[i]);
    mem_free(jobs);
    return view_page(r, items, next);
}

/* --- submitting -------------------------------------------------------------------------- */

/* Loads the scene that the request names. false: with an entry in params where no job may use it, or *refusal where
 * the database failed. */
static bool find_scene(struct api *api, const struct request *r, const char *id, struct scene_row *row, cJSON *params,
                       struct response **refusal) {
    size_t digits = strspn(id, "0123456789abcdef");
    struct error err;
    if (digits < 8 || digits > 64 || id[digits] != '\0') {
        problem_param(params, "scene", NULL, "is not a scene's id: 8 to 64 lower-case hex digits");
        return false;
    }
    enum status status = auth_find_scene(api, r, id, row, &err);
    if (status == STATUS_NOT_FOUND || status == STATUS_CONFLICT)
        problem_param(params, "scene", NULL, "%s", err.message);
    else if (status != STATUS_OK)
        *refusal = problem_from(r, &err);
    else if (row->state != SCENE_REJECTED)
        return true;
    else {
        problem_param(params, "scene", "GET /v1/scenes/{id} lists what is wrong with it", "was rejected");
        scene_row_release(row);
    }
    return false;
}

static struct response *dry_run_reply(const struct scene_row *scene, const struct settings *settings) {
    cJSON *value = cJSON_CreateObject();
    json_add_bool(value, "dry_run", true);
    json_add_string(value, "scene", scene->id);
    json_add_string(value, "scene_state", scene_state_name(scene->state));
    json_add(value, "settings", settings_to_json(settings));
    return response_json(200, value);
}

static struct response *add_job(struct api *api, const struct request *r, const struct job_request *w,
                                const struct scene_row *scene) {
    struct error err;
    char *settings = w->settings ? json_text(w->settings) : mem_strdup("{}");
    char digest[SHA256_HEX_SIZE];
    sha256_of(buf_text(&r->body), r->body.length, digest);
    struct job_new job = {
        .scene_id = scene->id,
        .owner_id = r->caller.user_id,
        .is_shared = w->shared == 1,
        .name = w->name ? w->name : scene->name,
        .labels = w->labels ? w->labels : "{}",
        .settings = settings,
        .priority = w->priority == INT_MIN ? 0 : w->priority,
        .max_attempts = api->config.max_attempts,
        .user_queue_limit = api->config.user_queue_limit,
        .user_max_jobs = api->config.user_max_jobs,
        .webhook_url = w->webhook_url,
        .webhook_secret = w->webhook_secret,
        .idempotency_key = request_field(r, "Idempotency-Key"),
        .request_sha256 = digest,
    };
    int64_t id = 0;
    bool replayed = false;
    enum status status = store_job_add(api->store, &job, api->config.queue_limit, &id, &replayed, &err);
    mem_free(settings);
    /* The key was used for another request, or the scene has just been rejected or removed. */
    if (status == STATUS_CONFLICT || status == STATUS_NOT_FOUND)
        return problem_full(r, 422, err.message, err.hint, NULL);
    if (status != STATUS_OK)
        return problem_from(r, &err);
    if (!replayed)
        scheduler_wake(api->scheduler);
    struct response *reply = job_reply_of(api, r, id, replayed ? 200 : 201);
    response_field(reply, "Location", "/v1/jobs/%lld", (long long)id);
    if (replayed)
        response_field(reply, "Idempotency-Replayed", "true");
    return reply;
}

static struct response *check_submission(const struct request *r, bool *dry_run) {
    const char *key = request_field(r, "Idempotency-Key");
    struct response *refusal = retention_dry_run(r, dry_run);
    if (refusal)
        return refusal;
    size_t length = key ? strlen(key) : 1;
    bool visible = true;
    for (size_t i = 0; key && i < length; i++)
        visible = visible && key[i] > 0x20 && key[i] < 0x7f;
    if (length < 1 || length > 200 || !visible)
        return problem(r, 400, "Idempotency-Key must be 1 to 200 visible ASCII characters");
    return NULL;
}

struct response *jobs_add(struct api *api, struct request *r) {
    bool dry_run;
    struct response *reply = check_submission(r, &dry_run);
    if (reply)
        return reply;
    cJSON *params = cJSON_CreateArray();
    struct job_request w;
    struct scene_row scene;
    struct settings settings;
    bool has_scene = false;
    settings_init(&settings);
    reply = job_request_read(r, &w, true, params);
    if (!reply)
        job_request_settings(&w, &settings, params);
    if (!reply && w.scene)
        has_scene = find_scene(api, r, w.scene, &scene, params, &reply);
    if (!reply && cJSON_GetArraySize(params) > 0) {
        reply = problem_invalid(r, "the job is invalid", params);
        params = NULL;
    }
    if (!reply)
        reply = job_request_fit(r, &scene, &settings);
    if (!reply && !dry_run)
        reply = space_check_room(api, r, 0);
    if (!reply && !dry_run)
        reply = space_check_share(api, r, NULL, 0);
    if (!reply)
        reply = dry_run ? dry_run_reply(&scene, &settings) : add_job(api, r, &w, &scene);
    if (has_scene)
        scene_row_release(&scene);
    settings_release(&settings);
    cJSON_Delete(params);
    job_request_release(&w);
    return reply;
}

/* --- changing ---------------------------------------------------------------------------- */

/* The revision that If-Match asks for, -1 for any; or *refusal. */
static int64_t expected_revision(const struct request *r, struct response **refusal) {
    const char *match = request_field(r, "If-Match");
    int64_t revision = -1;
    char digits[24];
    int end = 0;
    if (!match)
        *refusal = problem_full(r, 428, "a change needs If-Match",
                                "send the job's ETag, or * to change whatever is there", NULL);
    else if (strcmp(match, "*") != 0 && (sscanf(match, "\"rev-%20[0-9]\"%n", digits, &end) != 1 || end == 0 ||
                                         match[end] != '\0' || !field_number(digits, 0, INT64_MAX, &revision)))
        *refusal = problem(r, 412, "If-Match names none of this job's revisions");
    return revision;
}

struct response *jobs_patch(struct api *api, struct request *r) {
    struct response *reply = NULL;
    int64_t id = auth_job_id(api, r, ACCESS_CHANGE, &reply);
    int64_t revision = reply ? -1 : expected_revision(r, &reply);
    if (reply)
        return reply;
    cJSON *params = cJSON_CreateArray();
    struct job_request w;
    struct error err;
    reply = job_request_read(r, &w, false, params);
    if (!reply && cJSON_GetArraySize(params) > 0) {
        reply = problem_invalid(r, "the change is invalid", params);
        params = NULL;
    }
    if (!reply) {
        struct job_patch patch = {.name = w.name,
                                  .labels = w.labels,
                                  .priority = w.priority,
                                  .shared = w.shared,
                                  .place = w.place,
                                  .before_id = w.before,
                                  .retention = w.retention};
        enum status status = store_job_patch(api->store, id, revision, &patch, &err);
        if (status == STATUS_CONFLICT)
            reply = problem_full(r, 412, err.message, "GET the job and try again", NULL);
        else if (status != STATUS_OK)
            reply = problem_from(r, &err);
        else
            reply = job_reply_of(api, r, id, 200);
    }
    scheduler_wake(api->scheduler);
    cJSON_Delete(params);
    job_request_release(&w);
    return reply;
}

/* The reply to a dry run: what removing the job would free. */
static struct response *measure_job(struct api *api, const struct request *r, int64_t id) {
    struct job job;
    struct error err;
    if (store_job_get(api->store, id, &job, &err) != STATUS_OK)
        return problem_from(r, &err);
    bool is_running = job.state == JOB_RUNNING;
    job_release(&job);
    if (is_running)
        return problem_full(r, 409, "the job is running", "Cancel it first.", NULL);
    char *path = layout_job(NULL, id);
    struct response *reply = retention_would_free(api, r, path);
    mem_free(path);
    return reply;
}

struct response *jobs_delete(struct api *api, struct request *r) {
    bool dry_run;
    struct response *refusal = retention_dry_run(r, &dry_run);
    int64_t id = refusal ? 0 : auth_job_id(api, r, ACCESS_CHANGE, &refusal);
    if (refusal)
        return refusal;
    if (dry_run)
        return measure_job(api, r, id);
    struct error err;
    enum status status = store_job_delete(api->store, id, &err);
    if (status == STATUS_OK) {
        char *path = layout_job(NULL, id);
        status = trash_take(api->folder.trash, path, &err);
        mem_free(path);
    }
    return status == STATUS_OK ? response_new(204) : problem_from(r, &err);
}
