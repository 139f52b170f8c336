/* lanes.c -- see lanes.h. */
#include "server/job/lanes.h"

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

void lanes_init(struct lanes *l, const struct scheduler_config *config, struct store *store,
                struct counters *counters) {
    *l = (struct lanes){.config = config, .store = store, .counters = counters};
    admission_init(&l->admission, config->jobs_memory_bytes, config->worker_memory_bytes);
    admission_init(&l->small_admission, config->jobs_memory_bytes, config->worker_memory_bytes);
    executors_init(&l->places, config);
    l->main_slots = l->places.slots + count_elsewhere(store);
    l->job_slots = l->main_slots + (size_t)config->small_renders;
}

void lanes_release(struct lanes *l) {
    executors_release(&l->places);
    mem_free(l->executors);
}

void lanes_forget_reasons(struct lanes *l) { l->admission.told_id = l->small_admission.told_id = -1; }

/* Threads of this machine for one more attempt: an equal share among those that run or could run now. A worker keeps
 * the threads it started with, so the shares are approximate. */
static int thread_share(struct lanes *l) {
    int64_t limit = l->config->max_running > 0 ? l->config->max_running : 1, sharing = 1;
    if (store_attempts_wanted(l->store, &sharing, NULL) != STATUS_OK)
        sharing = 1;
    sharing = sharing < 1 ? 1 : sharing > limit ? limit : sharing;
    int share = l->config->thread_count / (int)sharing;
    return share > 0 ? share : 1;
}

/* Charges CPU time, before the next user is chosen. */
static void charge_all(struct lanes *l) {
    struct store_counts counts;
    if (store_count(l->store, &counts, NULL) != STATUS_OK || counts.jobs_by_state[JOB_QUEUED] == 0)
        return;
    for (size_t i = 0; i < l->job_slots; i++)
        if (l->slot[i].phase == ATTEMPT_ALIVE)
            attempt_charge(&l->slot[i], l->store, l->counters);
    (void)store_usage_pay(l->store, NULL); /* charges that failed earlier */
}

/* Threads of one small render: those of the lane are shared by its slots. */
static int small_thread_share(const struct lanes *l) {
    int threads = l->config->small_render_threads > 0 ? l->config->small_render_threads : l->config->thread_count;
    int share = threads / (int)(l->job_slots - l->main_slots);
    return share > 0 ? share : 1;
}

/* Whether there is memory on this machine for the job beside those that run on it. */
static enum status ask_admission(struct lanes *l, bool is_small, int64_t id, bool *may, double *need,
                                 struct error *err) {
    size_t running = 0;
    double used = 0.0;
    for (size_t i = 0; i < l->job_slots; i++) {
        bool is_here = l->slot[i].phase == ATTEMPT_ALIVE && l->slot[i].executor == l->config->executor;
        running += is_here;
        used += is_here ? l->slot[i].memory_bytes : 0.0;
    }
    struct admission *a = is_small ? &l->small_admission : &l->admission;
    enum status status = admission_ask(a, l->store, id, running, used, may, need, err);
    l->admission.total_bytes = l->small_admission.total_bytes = a->total_bytes;
    return status;
}

/* The job of the lane whose turn it is, of those that may begin somewhere, and where. STATUS_NOT_FOUND: there is
 * none. */
static enum status next_job(struct lanes *l, bool is_small, int64_t *id, const struct executor **where, double *need,
                            struct error *err) {
    struct job_lane lane = {.small_cost = l->config->small_render_cost, .is_small = is_small};
    for (bool may = false; !may;) {
        char *names = is_small ? NULL : executors_free(&l->places), *chosen = NULL;
        if (!names && !is_small)
            return error_set(err, STATUS_NOT_FOUND, "no place is free");
        charge_all(l);
        lane.executors = names;
        lane.anywhere = executors_for(&l->places, "") != NULL;
        enum status status = store_job_next(l->store, l->config->user_max_running, &lane, id, err);
        mem_free(names);
        if (status == STATUS_OK)
            status = store_job_executor(l->store, *id, &chosen, err);
        struct executor_use *use = status == STATUS_OK && !is_small ? executors_for(&l->places, chosen) : NULL;
        mem_free(chosen);
        *where = use ? use->executor : l->config->executor;
        if (status == STATUS_OK && !use && !is_small)
            return error_set(err, STATUS_NOT_FOUND, "its place is taken");
        if (status != STATUS_OK || *where != l->config->executor)
            return status;
        status = ask_admission(l, is_small, *id, &may, need, err);
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
static enum status start_lane(struct lanes *l, bool is_small, struct error *err) {
    size_t end = is_small ? l->job_slots : l->main_slots;
    executors_count(&l->places, l->slot, l->main_slots);
    for (size_t i = is_small ? l->main_slots : 0; i < end; i++) {
        /* The slot stays empty if the job left the queue without starting: take the next one. */
        while (l->slot[i].phase == ATTEMPT_EMPTY) {
            struct scheduler_config with = *l->config;
            double need = 0.0;
            int64_t id;
            enum status status = next_job(l, is_small, &id, &with.executor, &need, err);
            if (status == STATUS_NOT_FOUND)
                return STATUS_OK;
            if (status == STATUS_OK)
                status = attempt_start_job(&l->slot[i], &with, l->store, l->counters, id,
                                           is_small ? small_thread_share(l) : thread_share(l), err);
            if (status != STATUS_OK)
                return status;
            l->slot[i].memory_bytes = need;
            executors_add(&l->places, is_small ? NULL : l->slot[i].executor);
        }
    }
    return STATUS_OK;
}

/* Queued jobs that must run where nothing is any more say so; those whose executor is there again forget it. */
static enum status explain_executors(struct lanes *l, struct error *err) {
    enum status status = STATUS_OK;
    if (!l->executors)
        l->executors = executors_names(&l->places);
    if (!l->knows_executors)
        status = store_job_explain(l->store, 0, "", EXECUTOR_REASON, "", err);
    l->knows_executors |= status == STATUS_OK;
    while (status == STATUS_OK) {
        char *name, *reason;
        int64_t id;
        status = store_job_unplaced(l->store, l->executors, EXECUTOR_REASON, &id, &name, err);
        if (status != STATUS_OK)
            break;
        reason = mem_printf(EXECUTOR_REASON ": %.31s", name);
        status = store_job_explain(l->store, id, reason, "",
                                   "An administrator can configure it again (option executors). Or cancel the job, and "
                                   "submit it without executor.",
                                   err);
        mem_free(reason);
        mem_free(name);
    }
    return status == STATUS_NOT_FOUND ? STATUS_OK : status;
}

enum status lanes_start(struct lanes *l, struct error *err) {
    struct error other, unexplained;
    enum status explained = explain_executors(l, &unexplained), status = start_lane(l, true, err);
    enum status main_status = start_lane(l, false, status == STATUS_OK ? err : &other);
    status = status == STATUS_OK ? main_status : status;
    if (status == STATUS_OK && explained != STATUS_OK)
        *err = unexplained;
    return status == STATUS_OK ? explained : status;
}
