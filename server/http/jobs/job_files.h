/* job_files.h -- PUT /v1/jobs/{job}/files/{name}: files that a job's settings name, sent before it begins. */
#ifndef UNBAKE_HTTP_JOBS_JOB_FILES_H
#define UNBAKE_HTTP_JOBS_JOB_FILES_H

#include "server/http/api.h"
#include "server/transport/message.h"

/* The head is complete: makes r->upload, or returns the refusal. What arrives goes through whole_body_data. */
struct response *job_files_begin(struct api *api, struct request *r);

#endif
