/* job_reply.h -- the reply that shows a job: its JSON view, with its revision as ETag. */
#ifndef UNBAKE_HTTP_JOBS_JOB_REPLY_H
#define UNBAKE_HTTP_JOBS_JOB_REPLY_H

#include "server/http/api.h"
#include "server/transport/message.h"

/* Releases the job. A GET with the ETag in If-None-Match gets 304. */
struct response *job_reply(const struct request *r, struct job *job, int status);
/* Of the job as the database has it now; a problem where it is gone. */
struct response *job_reply_of(struct api *api, const struct request *r, int64_t id, int status);

#endif
