/* dispatch.h -- which queued job begins next, and where.
 *
 * Small renders have a lane of their own, so that a preview does not wait behind hours of work. A lane's slots are
 * filled in the users' turns (store_job_next), as far as an executor has a place (executors.h) and, on this machine,
 * the memory that is foretold for the job is free (admission.h). Not thread-safe: the scheduler's thread. */
#ifndef UNBAKE_JOB_DISPATCH_H
#define UNBAKE_JOB_DISPATCH_H

#include "server/job/admission.h"
#include "server/job/attempt.h"
#include "server/job/executors.h"

struct dispatch {
    const struct scheduler_config *config; /* borrowed, all three */
    struct store *store;
    struct counters *counters;
    struct executors places;
    size_t main_slots, job_slots; /* slots of the main lane; of both, the small renders' last */
    bool knows_executors;         /* what an earlier daemon has said of them is forgotten */
    char *executors;              /* names of all, as store_job_next takes them; owned; NULL before the first round */
    struct attempt *slot;         /* [job_slots]; borrowed, set by the owner */
    struct admission admission, small_admission;
};

void dispatch_init(struct dispatch *d, const struct scheduler_config *config, struct store *store,
                   struct counters *counters);
void dispatch_release(struct dispatch *d);

/* Fills the free slots. An error of one lane does not keep the other from starting; the first is returned. */
enum status dispatch_start(struct dispatch *d, struct error *err);

/* The reasons for which jobs wait have been replaced by another: they are to be told again. */
void dispatch_forget_reasons(struct dispatch *d);

#endif
