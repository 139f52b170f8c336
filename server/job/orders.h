/* orders.h -- what a worker is told to do (worker/order.h), of an attempt of a job or of the check of a scene. */
#ifndef UNBAKE_JOB_ORDERS_H
#define UNBAKE_JOB_ORDERS_H

#include "common/json.h"
#include "server/job/scheduler_config.h"
#include "server/store/store.h"

/* The members that all orders have; the caller's. */
cJSON *orders_new(const char *kind, const struct scheduler_config *config, int thread_count);

/* An attempt of a job, of which a store's rows are borrowed. */
struct job_work {
    const struct job *job;
    const struct scene_row *scene; /* the job's; of a render it may be empty */
    const struct job_part *part;
    int number, thread_count;
};
/* Its order. *order is the caller's in any case. */
enum status orders_of_job(const struct job_work *work, const struct scheduler_config *config, struct store *store,
                          cJSON **order, struct error *err);

#endif
