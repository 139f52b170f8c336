/* job_request.h -- the body of POST /v1/jobs or of PATCH /v1/jobs/ID. */
#ifndef UNBAKE_HTTP_JOBS_JOB_REQUEST_H
#define UNBAKE_HTTP_JOBS_JOB_REQUEST_H

#include <stdbool.h>
#include <stdint.h>

#include "common/json.h"
#include "common/settings.h"
#include "server/store/store.h"
#include "server/transport/message.h"

/* Pointers point into `body`. */
struct job_request {
    cJSON *body; /* owned */
    enum job_kind kind;
    int64_t source; /* the job whose outputs are read; 0: not given */
    const char *scene, *name;
    const cJSON *settings;
    char *labels;                             /* JSON text; owned; NULL: not given */
    const char *webhook_url, *webhook_secret; /* NULL: none */
    int priority;                             /* INT_MIN: not given */
    int shared;                               /* -1: not given */
    enum job_place place;
    int64_t before; /* with JOB_PLACE_BEFORE */
    struct retention retention;
};

/* Reads and checks the request's body; all faults are added to the array `params` (problem_param). NULL, or a reply
 * where the body is not a JSON object. *w needs job_request_release in any case. */
struct response *job_request_read(const struct request *r, struct job_request *w, bool is_new, cJSON *params);
void job_request_release(struct job_request *w);

/* Adds what is wrong with settings (common/setting_faults.h) to the faults of a request. */
void job_request_faults(const cJSON *problems, cJSON *params);
/* Applies the body's settings, if any, to *settings; faults as above, with "settings." before their names. */
void job_request_settings(const struct job_request *w, struct settings *settings, cJSON *params);

/* A problem where the settings name an executor that is not one of `names` (separated by spaces or commas; NULL: all
 * are known). */
void job_request_executor(const char *chosen, const char *names, cJSON *params);

/* NULL where mesh and photographs of the scene fit, as far as is known, or the job takes them as they are; else 409,
 * with the remedy. */
struct response *job_request_fit(const struct request *r, const struct scene_row *scene,
                                 const struct settings *settings);

#endif
