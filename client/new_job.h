/* new_job.h -- what the commands that queue a job have in common: options, the body of POST /v1/jobs, the request. */
#ifndef UNBAKE_CLIENT_NEW_JOB_H
#define UNBAKE_CLIENT_NEW_JOB_H

#include "client/client.h"

#define NEW_JOB_OPTIONS                                                                                                \
    {"priority", 'p', OPTION_WHOLE, "N", "-100 to 100, larger goes first (0)"},                                        \
        {"label", 'l', OPTION_LIST, "KEY=VALUE", "a label of your own"}, {                                             \
        "webhook", 0, OPTION_TEXT, "URL",                                                                              \
            "is told of the job's states, signed with $UNBAKE_WEBHOOK_SECRET (whsec_ and base64)"                      \
    }
#define WATCH_OPTION                                                                                                   \
    { "watch", 'w', OPTION_FLAG, NULL, "follow the job to its end, as `unbake watch` does" }

/* Adds to `job` what the command line says of it: settings by `parse` (as settings_parse_assignment), labels, priority,
 * name, share, webhook. */
enum status new_job_describe(cJSON *job, const struct options *o,
                             enum status (*parse)(const char *text, cJSON *settings, struct error *err),
                             struct error *err);
/* Queues it under an idempotency key: however often the request is sent, one job results. */
enum status new_job_queue(struct client *c, const cJSON *job, struct reply *reply, struct error *err);

/* Adds "key=value" to an object of labels. */
enum status label_add(cJSON *labels, const char *text, struct error *err);

#endif
