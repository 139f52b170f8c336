/* job_reply.c -- see job_reply.h. */
#include "server/http/jobs/job_reply.h"

#include <stdio.h>

#include "server/http/views.h"
#include "server/transport/problem.h"

struct response *job_reply(const struct request *r, struct job *job, int status) {
    char etag[48];
    snprintf(etag, sizeof etag, "\"rev-%lld\"", (long long)job->revision);
    struct response *reply;
    if (status == 200 && r->method == METHOD_GET) {
        reply = view_tagged(r, view_job(job, &r->caller), etag);
    } else {
        reply = response_json(status, view_job(job, &r->caller));
        response_field(reply, "ETag", "%s", etag);
    }
    job_release(job);
    return reply;
}

struct response *job_reply_of(struct api *api, const struct request *r, int64_t id, int status) {
    struct job job;
    struct error err;
    if (store_job_get(api->store, id, &job, &err) != STATUS_OK)
        return problem_from(r, &err);
    return job_reply(r, &job, status);
}
