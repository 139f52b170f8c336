/* job_submit.c -- POST /v1/jobs: a job of any kind, checked as a whole before anything of it is stored.
 *
 *      reconstruct   reads a scene
 *      render        reads the outputs of a reconstruction, its source, and files that its settings name, which are
 *                    sent afterwards (job_files.h)
 *      evaluate      reads the outputs of its source, and a scene that holds a truth: its source's unless another is
 *                    named
 */
#include <limits.h>
#include <stdio.h>
#include <string.h>

#include "common/mem.h"
#include "common/render_settings.h"
#include "common/settings.h"
#include "common/sha256.h"
#include "server/data/work_file.h"
#include "server/http/auth.h"
#include "server/http/handlers.h"
#include "server/http/jobs/job_reply.h"
#include "server/http/jobs/job_request.h"
#include "server/http/jobs/render_request.h"
#include "server/http/retention.h"
#include "server/http/space.h"
#include "server/transport/problem.h"

struct job_submission {
    struct api *api;
    const struct request *r;
    struct job_request w;
    struct settings settings;     /* of a reconstruction */
    struct render_request render; /* of a render */
    struct scene_row scene;       /* if has_scene */
    struct job source;            /* if has_source */
    bool has_scene, has_source;
    cJSON *params; /* faults; NULL once they have been sent */
};

/* Loads the scene that the request names: with an entry in params where no job may use it, or a reply where the
 * database failed. */
static struct response *find_scene(struct job_submission *s, const char *id) {
    size_t digits = strspn(id, "0123456789abcdef");
    char hint[SCENE_ID_SIZE + 64];
    struct error err;
    if (digits < 8 || digits > 64 || id[digits] != '\0') {
        problem_param(s->params, "scene", NULL, "is not a scene's id: 8 to 64 lower-case hex digits");
        return NULL;
    }
    enum status status = auth_find_scene(s->api, s->r, id, &s->scene, &err);
    s->has_scene = status == STATUS_OK;
    if (status == STATUS_NOT_FOUND || status == STATUS_CONFLICT)
        problem_param(s->params, "scene", NULL, "%s", err.message);
    else if (status != STATUS_OK)
        return problem_from(s->r, &err);
    else if (s->scene.state == SCENE_REJECTED) {
        snprintf(hint, sizeof hint, "GET /v1/scenes/%s lists what is wrong with it", s->scene.id);
        problem_param(s->params, "scene", hint, "was rejected");
    }
    return NULL;
}

/* Loads the job that the request reads, likewise. */
static struct response *find_source(struct job_submission *s) {
    struct error err;
    long long id = (long long)s->w.source;
    enum status status = store_job_get(s->api->store, id, &s->source, &err);
    if (status != STATUS_OK && status != STATUS_NOT_FOUND)
        return problem_from(s->r, &err);
    s->has_source = true;
    if (status == STATUS_NOT_FOUND || caller_access_job(&s->r->caller, &s->source) < ACCESS_READ)
        problem_param(s->params, "source", NULL, "there is no job %lld", id);
    return NULL;
}

static struct response *find_what_is_read(struct job_submission *s) {
    struct response *reply = s->w.source ? find_source(s) : NULL;
    if (reply)
        return reply;
    bool is_readable = s->has_source && caller_access_job(&s->r->caller, &s->source) >= ACCESS_READ;
    if (s->w.scene)
        return find_scene(s, s->w.scene);
    return s->w.kind == JOB_EVALUATE && is_readable ? find_scene(s, s->source.scene_id) : NULL;
}

static void check_settings(struct job_submission *s) {
    switch (s->w.kind) {
    case JOB_RECONSTRUCT:
        job_request_settings(&s->w, &s->settings, s->params);
        job_request_executor(settings_text(&s->settings, "executor"), s->api->config.executors, s->params);
        break;
    case JOB_RENDER:
        render_request_read(&s->render, s->w.settings, s->params);
        if (s->w.settings)
            job_request_executor(render_settings_text(s->w.settings, "executor"), s->api->config.executors, s->params);
        break;
    case JOB_EVALUATE:
        if (s->w.settings && (!cJSON_IsObject(s->w.settings) || s->w.settings->child))
            problem_param(s->params, "settings", NULL, "an evaluation has no settings");
        break;
    }
}

static struct response *reply_invalid(struct job_submission *s) {
    struct response *reply = problem_invalid(s->r, "the job is invalid", s->params);
    s->params = NULL;
    return reply;
}

/* 409 where the state of what is read forbids the job, 422 where a render's settings name what its room has not. */
static struct response *check_states(struct job_submission *s) {
    struct error err;
    if (s->w.kind == JOB_RECONSTRUCT)
        return job_request_fit(s->r, &s->scene, &s->settings);
    if (store_source_check_readable(s->api->store, s->source.id, &err) != STATUS_OK)
        return problem_from(s->r, &err);
    if (s->w.kind == JOB_RENDER) {
        render_request_check_room(s->api, &s->render, s->source.id, s->params);
        return cJSON_GetArraySize(s->params) > 0 ? reply_invalid(s) : NULL;
    }
    if (s->scene.state == SCENE_READY && !work_file_has_truth(s->api->config.data_dir, s->scene.id)) {
        error_set(&err, STATUS_CONFLICT, "scene %.12s has no truth to compare with", s->scene.id);
        error_hint(&err,
                   "Such a scene has truth/objects.json beside its photographs, as `unbaked demo-room` writes it.");
        return problem_from(s->r, &err);
    }
    return NULL;
}

static struct response *dry_run_reply(const struct job_submission *s) {
    cJSON *value = cJSON_CreateObject();
    json_add_bool(value, "dry_run", true);
    json_add_string(value, "kind", job_kind_name(s->w.kind));
    if (s->has_scene) {
        json_add_string(value, "scene", s->scene.id);
        json_add_string(value, "scene_state", scene_state_name(s->scene.state));
    }
    if (s->w.kind == JOB_RECONSTRUCT) {
        json_add(value, "settings", settings_to_json(&s->settings));
    } else {
        json_add_int(value, "source", s->source.id);
        json_add(value, "settings", s->w.settings ? cJSON_Duplicate(s->w.settings, true) : cJSON_CreateObject());
    }
    if (s->w.kind == JOB_RENDER)
        render_request_describe(s->api, &s->render, value);
    return response_json(200, value);
}

static struct response *add_job(struct job_submission *s) {
    struct api *api = s->api;
    const struct request *r = s->r;
    const struct job_request *w = &s->w;
    struct error err;
    char *settings = w->settings ? json_text(w->settings) : mem_strdup("{}");
    char digest[SHA256_HEX_SIZE];
    sha256_of(buf_text(&r->body), r->body.length, digest);
    struct job_new job = {
        .kind = w->kind,
        .source_id = w->source,
        .cost = s->render.cost,
        .file = (const char *const *)s->render.file,
        .file_count = s->render.file_count,
        .scene_id = s->has_scene ? s->scene.id : s->source.scene_id,
        .owner_id = r->caller.user_id,
        .is_shared = w->shared == 1,
        .name = w->name         ? w->name
                : s->has_source ? s->source.name
                                : s->scene.name,
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
    /* The key was used for another request, or what is read has just been rejected or removed. */
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

static struct response *submit(struct job_submission *s, bool dry_run) {
    check_settings(s);
    struct response *reply = find_what_is_read(s);
    if (!reply && cJSON_GetArraySize(s->params) > 0)
        reply = reply_invalid(s);
    if (!reply)
        reply = check_states(s);
    if (!reply && !dry_run)
        reply = space_check_free(s->api, s->r, 0);
    if (!reply && !dry_run)
        reply = space_check_share(s->api, s->r, NULL, 0);
    return reply ? reply : dry_run ? dry_run_reply(s) : add_job(s);
}

struct response *jobs_add(struct api *api, struct request *r) {
    bool dry_run;
    struct response *reply = check_submission(r, &dry_run);
    if (reply)
        return reply;
    struct job_submission s = {.api = api, .r = r, .params = cJSON_CreateArray()};
    settings_init(&s.settings);
    reply = job_request_read(r, &s.w, true, s.params);
    if (!reply)
        reply = submit(&s, dry_run);
    if (s.has_scene)
        scene_row_release(&s.scene);
    if (s.has_source)
        job_release(&s.source);
    render_request_release(&s.render);
    settings_release(&s.settings);
    cJSON_Delete(s.params);
    job_request_release(&s.w);
    return reply;
}
