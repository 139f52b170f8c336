/* dispatch.c -- see dispatch.h. */
#include "server/job/dispatch.h"

#include "common/mem.h"
#include "server/store/remote.h"

/* Attempts that go on without a daemon: the limits may have been higher when they began. */
static size_t count_elsewhere(struct store *store) {
    struct remote_row *rows;
    size_t count;
    struct error err;
    (void)store_remote_list(store, NULL, &rows, &count, &err); /* none where that fails, and the start of it all will */
    mem_free(rows);
    return count;
}

void dispatch_init(struct dispatch *d, const struct scheduler_config *config, struct store *store,
                   struct counters *counters) {
    *d = (struct dispatch){.config = config, .store = store, .counters = counters};
    admission_init(&d->admission, config->jobs_memory_bytes, config->worker_memory_bytes);
    admission_init(&d->small_admission, config->jobs_memory_bytes, config->worker_memory_bytes);
    executors_init(&d->places, config);
    d->main_slots = d->places.slots + count_elsewhere(store);
    d->job_slots = d->main_slots + (size_t)config->small_renders;
}

void dispatch_release(struct dispatch *d) {
    executors_release(&d->places);
    mem_free(d->executors);
}

void dispatch_forget_reasons(struct dispatch *d) { d->admission.told_id = d->small_admission.told_id = -1; }

/* Threads of this machine for one more attempt: an equal share among those that run or could run now. A worker keeps
 * the threads it started with, so the shares are approximate. */
static int thread_share(struct dispatch *d) {
    int64_t limit = d->config->max_running > 0 ? d->config->max_running : 1, sharing = 1;
    if (store_attempts_wanted(d->store, &sharing, NULL) != STATUS_OK)
        sharing = 1;
    sharing = sharing < 1 ? 1 : sharing > limit ? limit : sharing;
    int share = d->config->thread_count / (int)sharing;
    return share > 0 ? share : 1;
}

/* Charges CPU time, before the next user is chosen. */
static void charge_all(struct dispatch *d) {
    struct store_counts counts;
    if (store_count(d->store, &counts, NULL) != STATUS_OK || counts.jobs_by_state[JOB_QUEUED] == 0)
        return;
    for (size_t i = 0; i < d->job_slots; i++)
        if (d->slot[i].phase == ATTEMPT_ALIVE)
            attempt_charge(&d->slot[i], d->store, d->counters);
    (void)store_usage_pay(d->store, NULL); /* charges that failed earlier */
}

/* Threads of one small render: those of the lane are shared by its slots. */
static int small_thread_share(const struct dispatch *d) {
    int threads = d->config->small_render_threads > 0 ? d->config->small_render_threads : d->config->thread_count;
    int share = threads / (int)(d->job_slots - d->main_slots);
    return share > 0 ? share : 1;
}

/* Whether there is memory on this machine for the job beside those that run on it. */
static enum status ask_admission(struct dispatch *d, bool is_small, int64_t id, bool *may, double *need,
                                 struct error *err) {
    size_t running = 0;
    double used = 0.0;
    for (size_t i = 0; i < d->job_slots; i++) {
        bool is_here = d->slot[i].phase == ATTEMPT_ALIVE && d->slot[i].executor == d->config->executor;
        running += is_here;
        used += is_here ? d->slot[i].memory_bytes : 0.0;
    }
    struct admission *a = is_small ? &d->small_admission : &d->admission;
    enum status status = admission_decide(a, d->store, id, running, used, may, need, err);
    d->admission.total_bytes = d->small_admission.total_bytes = a->total_bytes;
    return status;
}

/* The job of the lane whose turn it is, of those that may begin somewhere, and where. STATUS_NOT_FOUND: there is
 * none. */
static enum status next_job(struct dispatch *d, bool is_small, int64_t *id, const struct executor **where, double *need,
                            struct error *err) {
    struct job_lane lane = {.small_cost = d->config->small_render_cost, .is_small = is_small};
    for (bool may = false; !may;) {
        char *names = is_small ? NULL : executors_available(&d->places), *chosen = NULL;
        if (!names && !is_small)
            return error_set(err, STATUS_NOT_FOUND, "no place is free");
        charge_all(d);
        lane.executors = names;
        lane.anywhere = executors_for(&d->places, "") != NULL;
        enum status status = store_job_next(d->store, d->config->user_max_running, &lane, id, err);
        mem_free(names);
        if (status == STATUS_OK)
            status = store_job_executor(d->store, *id, &chosen, err);
        struct executor_use *use = status == STATUS_OK && !is_small ? executors_for(&d->places, chosen) : NULL;
        mem_free(chosen);
        *where = use ? use->executor : d->config->executor;
        if (status == STATUS_OK && !use && !is_small)
            return error_set(err, STATUS_NOT_FOUND, "its place is taken");
        if (status != STATUS_OK || *where != d->config->executor)
            return status;
        status = ask_admission(d, is_small, *id, &may, need, err);
        if (status != STATUS_OK)
            return status;
        if (!may && !use)
            return error_set(err, STATUS_NOT_FOUND, "there is no memory for it");
        if (!may)
            use->is_closed = true; /* for all behind it, too; elsewhere there may be a place */
    }
    return STATUS_OK;
}

/* Fills the slots of a lane. */
static enum status start_lane(struct dispatch *d, bool is_small, struct error *err) {
    size_t end = is_small ? d->job_slots : d->main_slots;
    executors_count(&d->places, d->slot, d->main_slots);
    for (size_t i = is_small ? d->main_slots : 0; i < end; i++) {
        /* The slot stays empty if the job left the queue without starting: take the next one. */
        while (d->slot[i].phase == ATTEMPT_EMPTY) {
            struct scheduler_config with = *d->config;
            double need = 0.0;
            int64_t id;
            enum status status = next_job(d, is_small, &id, &with.executor, &need, err);
            if (status == STATUS_NOT_FOUND)
                return STATUS_OK;
            if (status == STATUS_OK)
                status = attempt_start_job(&d->slot[i], &with, d->store, d->counters, id,
                                           is_small ? small_thread_share(d) : thread_share(d), err);
            if (status != STATUS_OK)
                return status;
            d->slot[i].memory_bytes = need;
            executors_add(&d->places, is_small ? NULL : d->slot[i].executor);
        }
    }
    return STATUS_OK;
}

/* Queued jobs that must run where nothing is any more say so; those whose executor is there again forget it. */
static enum status explain_executors(struct dispatch *d, struct error *err) {
    enum status status = STATUS_OK;
    if (!d->executors)
        d->executors = executors_names(&d->places);
    if (!d->knows_executors)
        status = store_job_explain(d->store, 0, "", EXECUTOR_REASON, "", err);
    d->knows_executors |= status == STATUS_OK;
    while (status == STATUS_OK) {
        char *name, *reason;
        int64_t id;
        status = store_job_unplaced(d->store, d->executors, EXECUTOR_REASON, &id, &name, err);
        if (status != STATUS_OK)
            break;
        reason = mem_printf(EXECUTOR_REASON ": %.31s", name);
        status = store_job_explain(d->store, id, reason, "",
                                   "An administrator can configure it again (option executors). Or cancel the job, and "
                                   "submit it without executor.",
                                   err);
        mem_free(reason);
        mem_free(name);
    }
    return status == STATUS_NOT_FOUND ? STATUS_OK : status;
}

enum status dispatch_start(struct dispatch *d, struct error *err) {
    struct error other, unexplained;
    enum status explained = explain_executors(d, &unexplained), status = start_lane(d, true, err);
    enum status main_status = start_lane(d, false, status == STATUS_OK ? err : &other);
    status = status == STATUS_OK ? main_status : status;
    if (status == STATUS_OK && explained != STATUS_OK)
        *err = unexplained;
    return status == STATUS_OK ? explained : status;
}
