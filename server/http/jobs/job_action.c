/* job_action.c -- POST to /v1/jobs/{job}/...: cancel, pause, resume, retry, redeliver, extend. */
#include "common/mem.h"
#include "server/data/attempt_folder.h"
#include "server/http/auth.h"
#include "server/http/extension.h"
#include "server/http/handlers.h"
#include "server/http/jobs/job_reply.h"
#include "server/transport/problem.h"

static struct response *act(struct api *api, const struct request *r,
                            enum status (*action)(struct api *api, int64_t id, struct error *err)) {
    struct response *refusal = NULL;
    int64_t id = auth_job_id(api, r, ACCESS_CHANGE, &refusal);
    if (refusal)
        return refusal;
    struct error err;
    if (action(api, id, &err) != STATUS_OK)
        return problem_from(r, &err);
    scheduler_wake(api->scheduler);
    return job_reply_of(api, r, id, 202);
}

static enum status do_cancel(struct api *api, int64_t id, struct error *err) {
    return store_job_cancel(api->store, id, err);
}

static enum status do_pause(struct api *api, int64_t id, struct error *err) {
    return store_job_pause(api->store, id, err);
}

static struct count_limits limits_of(const struct api *api) {
    return (struct count_limits){api->config.queue_limit, api->config.user_queue_limit};
}

static enum status do_resume(struct api *api, int64_t id, struct error *err) {
    struct count_limits limits = limits_of(api);
    return store_job_resume(api->store, id, &limits, err);
}

static enum status do_redeliver(struct api *api, int64_t id, struct error *err) {
    return store_webhook_again(api->store, id, err);
}

struct response *job_action_redeliver(struct api *api, struct request *r) {
    return act(api, r, do_redeliver);
}

struct response *job_action_cancel(struct api *api, struct request *r) {
    return act(api, r, do_cancel);
}

struct response *job_action_pause(struct api *api, struct request *r) {
    return act(api, r, do_pause);
}

struct response *job_action_resume(struct api *api, struct request *r) {
    return act(api, r, do_resume);
}

struct response *job_action_retry(struct api *api, struct request *r) {
    struct response *refusal = NULL;
    const char *from = target_query(&r->target, "from");
    bool keeps_checkpoint;
    struct job job;
    if (!auth_job(api, r, ACCESS_CHANGE, &job, &refusal))
        return refusal;
    if (from && !job_stage_parse(job.kind, from, &keeps_checkpoint))
        refusal = problem_full(r, 400, "from must name a stage", job_stages(job.kind), NULL);
    int64_t id = job.id;
    job_release(&job);
    if (refusal)
        return refusal;
    struct error err;
    struct count_limits limits = limits_of(api);
    if (store_job_retry(api->store, id, api->config.max_attempts, from, &limits, &err) != STATUS_OK)
        return problem_from(r, &err);
    scheduler_wake(api->scheduler);
    return job_reply_of(api, r, id, 202);
}

struct response *job_action_extend(struct api *api, struct request *r) {
    struct response *refusal = NULL;
    struct job job;
    struct error err;
    struct count_limits limits = limits_of(api);
    int64_t id = auth_job_id(api, r, ACCESS_CHANGE, &refusal);
    if (refusal)
        return refusal;
    if (store_job_get(api->store, id, &job, &err) != STATUS_OK)
        return problem_from(r, &err);
    if (job.kind != JOB_RECONSTRUCT)
        refusal = problem_full(r, 409, "only a reconstruction can be extended", "submit another job", NULL);
    char *settings = refusal ? NULL : extension_settings(r, &job, &refusal);
    char *holder = NULL;
    if (!refusal && attempt_folder_with_checkpoint(api->config.data_dir, id, &holder, &err) != STATUS_OK)
        refusal = problem_from(r, &err);
    if (!refusal && job_is_terminal(job.state) && !holder)
        refusal = problem_full(r, 409, "the job's checkpoint is gone, so it cannot be continued",
                               "submit the room again, with more iterations or time", NULL);
    if (!refusal && store_job_extend(api->store, id, api->config.max_attempts, settings, &limits, &err) != STATUS_OK)
        refusal = problem_from(r, &err);
    mem_free(holder);
    mem_free(settings);
    job_release(&job);
    if (refusal)
        return refusal;
    scheduler_wake(api->scheduler);
    return job_reply_of(api, r, id, 202);
}
