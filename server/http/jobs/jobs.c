/* jobs.c -- /v1/jobs: list, show, change, delete. Submitting is job_submit.c. */
#include <limits.h>
#include <stdio.h>
#include <string.h>

#include "common/mem.h"
#include "server/data/layout.h"
#include "server/data/trash.h"
#include "server/http/auth.h"
#include "server/http/handlers.h"
#include "server/http/jobs/job_reply.h"
#include "server/http/jobs/job_request.h"
#include "server/http/retention.h"
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

/* What the query asks for; or why it cannot. *label is the caller's: the filter borrows it. */
static struct response *read_filter(const struct request *r, struct job_filter *filter, char **label) {
    const char *state_name = target_query(&r->target, "state"), *kind_name = target_query(&r->target, "kind");
    const char *source = target_query(&r->target, "source"), *labelled = target_query(&r->target, "label");
    enum job_state state = JOB_QUEUED;
    enum job_kind kind = JOB_RECONSTRUCT;
    *filter = (struct job_filter){.state = -1, .kind = -1};
    *label = NULL;
    if (state_name && !job_state_parse(state_name, &state))
        return problem_full(r, 400, "unknown state", "known: queued, running, paused, succeeded, failed, cancelled",
                            NULL);
    if (kind_name && !job_kind_parse(kind_name, &kind))
        return problem_full(r, 400, "unknown kind", "known: reconstruct, render, evaluate", NULL);
    if (source && !field_number(source, 1, INT64_MAX, &filter->source_id))
        return problem(r, 400, "source must be the number of a job");
    if (labelled && (!*labelled || *labelled == '=' || strlen(labelled) > 2 * API_LABEL_MAX_BYTES + 1))
        return problem(r, 400, "label must be KEY, or KEY=VALUE, of at most %d bytes each", API_LABEL_MAX_BYTES);
    if (state_name)
        filter->state = (int)state;
    if (kind_name)
        filter->kind = (int)kind;
    if (labelled) {
        size_t length = strcspn(labelled, "=");
        filter->label = *label = mem_strndup(labelled, length);
        filter->value = labelled[length] ? labelled + length + 1 : NULL;
    }
    return NULL;
}

/* One page of jobs. */
static struct response *list_jobs(struct api *api, struct request *r, const struct job_filter *filter) {
    struct response *refusal = NULL;
    const char *cursor = target_query(&r->target, "cursor");
    int64_t before = 0;
    if (cursor && !field_number(cursor, 1, INT64_MAX, &before))
        return problem(r, 400, "\"%.64s\" is no cursor of a list of jobs: a cursor is `next` of the page before",
                       cursor);
    size_t limit = view_limit(r, &refusal), count = 0;
    if (refusal)
        return refusal;
    struct job *jobs = mem_calloc(limit + 1, sizeof *jobs);
    struct error err;
    /* One row more than asked for shows that there is another page. */
    if (store_job_list(api->store, &r->caller, filter, before, limit + 1, jobs, &count, &err) != STATUS_OK) {
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

struct response *jobs_list(struct api *api, struct request *r) {
    struct job_filter filter;
    char *label;
    struct response *refusal = read_filter(r, &filter, &label);
    struct response *reply = refusal ? refusal : list_jobs(api, r, &filter);
    mem_free(label);
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
    if (store_source_check_unread(api->store, id, "deleted", &err) != STATUS_OK)
        return problem_from(r, &err);
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
