/* extension.h -- the request body that raises a job's limit: of iterations, of observations a texel, or of time. */
#ifndef UNBAKE_HTTP_EXTENSION_H
#define UNBAKE_HTTP_EXTENSION_H

#include "server/job/job.h"
#include "server/transport/message.h"

/* The job's settings, as JSON text, with the limit that the body names raised by the body's number; the caller's
 * (mem_free). NULL, and *refusal, where the body does not fit the job's settings. */
char *extension_settings(const struct request *r, const struct job *job, struct response **refusal);

#endif
