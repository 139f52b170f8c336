/* scheduler.c -- see scheduler.h.
 *
 * One loop: give free slots to what waits, tell workers what is requested of them, sleep in poll
 * until a worker says something, ends, must be killed, or somebody calls. While nothing happens
 * it does not wake up.
 *
 * Slots 0 .. max_running - 1 run jobs, the next small_renders small renders, the others check scenes: a check and a
 * small render are short and must not wait behind hours of work; nor a check behind another user's: checks.c. */
#include "server/job/scheduler.h"

#include <errno.h>
#include <math.h>
#include <poll.h>
#include <sched.h>
#include <stdatomic.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "common/clock.h"
#include "common/file.h"
#include "common/log.h"
#include "common/mem.h"
#include "server/job/admission.h"
#include "server/job/attempt.h"
#include "server/job/checks.h"
#include "server/job/deliveries.h"
#include "server/job/disk.h"
#include "server/job/worker_messages.h"
#include "server/store/remote.h"
#include "server/job/housekeeping.h"
#include "server/job/measure.h"
#include "server/job/outcome.h"
#include "server/job/executors.h"
#include "server/job/resume.h"

#define HOUSEKEEPING_SEC 600.0
#define RETRY_SEC 5.0 /* after a failure of the store or of a start */

struct scheduler {
    struct scheduler_config config;
    struct store *store;
    int wake_fd; /* an eventfd: many calls become one wake-up */
    atomic_bool stopping;
    atomic_int running;
    struct counters counters;
    atomic_ulong rounds;
    struct executors places;
    size_t main_slots, job_slots, slot_count;
    struct attempt *slot; /* [slot_count]; the first job_slots run jobs, of those from main_slots on small renders */
    struct checks checks;
    struct trash *trash;                         /* NULL: this thread removes trees itself */
    bool must_retry;                             /* something failed that may work later */
    double housekeeping_at;                      /* when it is due, as clock_sec */
    struct admission admission, small_admission; /* of the lanes */
    struct disk_watch disk;
    atomic_bool waits_for_disk; /* disk.is_low, for other threads */
    uint64_t check_room;        /* free bytes above which scenes that had too little are checked again; 0: none waits */
    struct deliveries deliveries;
    struct pollfd *poll; /* [1 + RUN_FDS * (slot_count + DELIVERIES_AT_ONCE)] */
};

/* Attempts that go on without a daemon: the limits may have been higher when they began. */
static size_t count_elsewhere(struct store *store) {
    struct remote_row *rows;
    size_t count;
    struct error err;
    (void)store_remote_list(store, NULL, &rows, &count, &err); /* none where that fails, and the start of it all will */
    mem_free(rows);
    return count;
}

enum status scheduler_new(struct scheduler **out, const struct scheduler_config *config, struct store *store,
                          struct error *err) {
    *out = NULL;
    int fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (fd < 0)
        return error_set_errno(err, errno, "cannot make an eventfd");
    struct scheduler *s = mem_calloc(1, sizeof *s);
    s->config = *config;
    s->store = store;
    s->wake_fd = fd;
    disk_init(&s->disk, config->low_disk_bytes);
    admission_init(&s->admission, config->jobs_memory_bytes, config->worker_memory_bytes);
    admission_init(&s->small_admission, config->jobs_memory_bytes, config->worker_memory_bytes);
    if (s->config.thread_count <= 0) {
        cpu_set_t set;
        s->config.thread_count = sched_getaffinity(0, sizeof set, &set) == 0 ? CPU_COUNT(&set) : 1;
    }
    executors_init(&s->places, config);
    s->main_slots = s->places.slots + count_elsewhere(store);
    s->job_slots = s->main_slots + (size_t)config->small_renders;
    if (config->small_renders == 0)
        s->config.small_render_cost = 0.0; /* without a lane of their own they wait with the others */
    s->slot_count = s->job_slots + (size_t)(config->max_checks > 0 ? config->max_checks : CHECKS_AT_ONCE);
    s->slot = mem_calloc(s->slot_count, sizeof *s->slot);
    s->poll = mem_calloc(1 + RUN_FDS * (s->slot_count + DELIVERIES_AT_ONCE), sizeof *s->poll);
    *out = s;
    return STATUS_OK;
}

void scheduler_use_trash(struct scheduler *s, struct trash *trash) { s->trash = trash; }

void scheduler_free(struct scheduler *s) {
    if (!s)
        return;
    close(s->wake_fd);
    for (size_t i = 0; i < s->slot_count; i++) /* what outlives this daemon, and what could not be entered */
        attempt_empty(&s->slot[i]);
    executors_release(&s->places);
    mem_free(s->slot);
    mem_free(s->poll);
    mem_free(s);
}

void scheduler_wake(struct scheduler *s) {
    uint64_t one = 1;
    /* write fails only when the counter is full; then the loop is awake already */
    if (write(s->wake_fd, &one, sizeof one) < 0)
        return;
}

void scheduler_stop(struct scheduler *s) {
    atomic_store(&s->stopping, true);
    scheduler_wake(s);
}

const struct counters *scheduler_counters(const struct scheduler *s) { return &s->counters; }

int scheduler_running(const struct scheduler *s) { return atomic_load(&s->running); }

bool scheduler_waits_for_disk(const struct scheduler *s) { return atomic_load(&s->waits_for_disk); }

/* A failure that is not the job's fault: log it once per round and retry. */
static void retry_later(struct scheduler *s, const char *what, const struct error *err) {
    if (!s->must_retry)
        log_error("%s: %s", what, err->message);
    s->must_retry = true;
}

/* Threads of this machine for one more job: an equal share among the jobs that run or could run now. A worker keeps the
 * threads it started with, so the shares are approximate. */
static int thread_share(struct scheduler *s) {
    struct store_counts counts;
    int64_t limit = s->config.max_running > 0 ? s->config.max_running : 1, sharing = 1;
    if (store_count(s->store, &counts, NULL) == STATUS_OK)
        sharing = counts.jobs_by_state[JOB_QUEUED] + counts.jobs_by_state[JOB_RUNNING];
    sharing = sharing < 1 ? 1 : sharing > limit ? limit : sharing;
    int share = s->config.thread_count / (int)sharing;
    return share > 0 ? share : 1;
}

/* Charges CPU time, before the next user is chosen. */
static void charge_all(struct scheduler *s) {
    struct store_counts counts;
    if (store_count(s->store, &counts, NULL) != STATUS_OK || counts.jobs_by_state[JOB_QUEUED] == 0)
        return;
    for (size_t i = 0; i < s->slot_count; i++)
        if (s->slot[i].phase == ATTEMPT_ALIVE)
            attempt_charge(&s->slot[i], s->store, &s->counters);
    (void)store_usage_pay(s->store, NULL); /* charges that failed earlier */
}

/* Threads of one small render: those of the lane are shared by its slots. */
static int small_thread_share(const struct scheduler *s) {
    int threads = s->config.small_render_threads > 0 ? s->config.small_render_threads : s->config.thread_count;
    int share = threads / (int)(s->job_slots - s->main_slots);
    return share > 0 ? share : 1;
}

/* Whether there is memory on this machine for the job beside those that run on it. */
static enum status ask_admission(struct scheduler *s, bool is_small, int64_t id, bool *may, double *need,
                                 struct error *err) {
    size_t running = 0;
    double used = 0.0;
    for (size_t i = 0; i < s->job_slots; i++) {
        bool is_here = s->slot[i].phase == ATTEMPT_ALIVE && s->slot[i].executor == s->config.executor;
        running += is_here;
        used += is_here ? s->slot[i].memory_bytes : 0.0;
    }
    struct admission *a = is_small ? &s->small_admission : &s->admission;
    enum status status = admission_ask(a, s->store, id, running, used, may, need, err);
    s->admission.total_bytes = s->small_admission.total_bytes = a->total_bytes;
    return status;
}

/* The job of the lane whose turn it is, of those that may begin somewhere, and where. STATUS_NOT_FOUND: there is none. */
static enum status next_job(struct scheduler *s, bool is_small, int64_t *id, const struct executor **where,
                            double *need, struct error *err) {
    struct job_lane lane = {.small_cost = s->config.small_render_cost, .is_small = is_small};
    for (bool may = false; !may;) {
        char *names = is_small ? NULL : executors_free(&s->places), *wish = NULL;
        if (!names && !is_small)
            return error_set(err, STATUS_NOT_FOUND, "no place is free");
        charge_all(s);
        lane.executors = names;
        lane.anywhere = executors_for(&s->places, "") != NULL;
        enum status status = store_job_next(s->store, s->config.user_max_running, &lane, id, err);
        mem_free(names);
        if (status == STATUS_OK)
            status = store_job_executor(s->store, *id, &wish, err);
        struct executor_use *use = status == STATUS_OK && !is_small ? executors_for(&s->places, wish) : NULL;
        mem_free(wish);
        *where = use ? use->executor : s->config.executor;
        if (status == STATUS_OK && !use && !is_small)
            return error_set(err, STATUS_NOT_FOUND, "its place is taken");
        if (status != STATUS_OK || *where != s->config.executor)
            return status;
        status = ask_admission(s, is_small, *id, &may, need, err);
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
static void start_lane(struct scheduler *s, bool is_small) {
    size_t end = is_small ? s->job_slots : s->main_slots;
    executors_count(&s->places, s->slot, s->main_slots);
    for (size_t i = is_small ? s->main_slots : 0; i < end; i++) {
        /* The slot stays empty if the job left the queue without starting: take the next one. */
        while (s->slot[i].phase == ATTEMPT_EMPTY) {
            struct scheduler_config with = s->config;
            struct error err;
            double need = 0.0;
            int64_t id;
            enum status status = next_job(s, is_small, &id, &with.executor, &need, &err);
            if (status == STATUS_NOT_FOUND)
                return;
            if (status == STATUS_OK)
                status = attempt_start_job(&s->slot[i], &with, s->store, &s->counters, id,
                                           is_small ? small_thread_share(s) : thread_share(s), &err);
            if (status != STATUS_OK) {
                retry_later(s, "cannot start a job", &err);
                return;
            }
            s->slot[i].memory_bytes = need;
            executors_add(&s->places, is_small ? NULL : s->slot[i].executor);
        }
    }
}

static void start_jobs(struct scheduler *s) {
    if (s->disk.is_low)
        return;
    start_lane(s, true);
    start_lane(s, false);
}

/* A check that fails for lack of space fills the disk for a moment. It is retried only when there is clearly more
 * space: an eighth more. */
static void postpone_check(struct scheduler *s) {
    uint64_t room = 0;
    struct error err;
    if (file_free_bytes(s->config.data_dir, &room, &err) != STATUS_OK)
        log_warning("%s", err.message);
    s->check_room = room + room / 8 + 1;
}

static enum status check_again(struct scheduler *s, struct error *err) {
    uint64_t room;
    if (s->check_room == 0)
        return STATUS_OK;
    enum status status = file_free_bytes(s->config.data_dir, &room, err);
    if (status != STATUS_OK || room < s->check_room)
        return status;
    status = store_scene_check_again(s->store, err);
    if (status == STATUS_OK)
        s->check_room = 0;
    return status;
}

static void start_checks(struct scheduler *s) {
    struct attempt *slots = s->slot + s->job_slots;
    struct error err;
    enum status status = check_again(s, &err);
    for (size_t i = 0; i < s->slot_count - s->job_slots && status == STATUS_OK; i++) {
        struct unchecked next;
        if (slots[i].phase != ATTEMPT_EMPTY)
            continue;
        status = checks_next(&s->checks, s->store, slots, s->slot_count - s->job_slots, &next, &err);
        if (status == STATUS_OK)
            status = attempt_start_check(&slots[i], &s->config, s->store, &next, s->config.thread_count, &err);
    }
    if (status != STATUS_OK && status != STATUS_NOT_FOUND)
        retry_later(s, "cannot check a scene", &err);
}

/* The request now, force after the grace period. */
static void ask_to_stop(struct scheduler *s, struct attempt *a) {
    if (a->phase != ATTEMPT_ALIVE || a->stopping)
        return;
    a->stopping = true;
    a->kill_at_sec = clock_sec() + s->config.stop_grace_sec + a->run->slow_sec;
    run_ask(a->run, RUN_STOP);
}

static void kill_now(struct attempt *a) {
    a->killed = true;
    a->kill_at_sec = 0.0;
    run_ask(a->run, RUN_KILL);
}

static void follow_wish(struct scheduler *s, struct attempt *a, enum job_wanted wanted) {
    if (wanted == JOB_WANT_PAUSE) {
        ask_to_stop(s, a);
    } else if (wanted == JOB_WANT_CANCEL && !a->killed) {
        a->stopping = true;
        kill_now(a); /* its state is no longer wanted */
    }
}

/* A job that the store has as running without an attempt: entering its false start had failed. */
static void requeue_orphan(struct scheduler *s, int64_t id) {
    struct job job;
    struct error err;
    enum status status = store_job_get(s->store, id, &job, &err);
    if (status == STATUS_OK)
        status = store_job_stop(s->store, id, job.attempt, "its start failed", &err);
    if (status != STATUS_OK)
        retry_later(s, "cannot queue a job again", &err);
    job_release(&job);
}

static void follow_wishes(struct scheduler *s) {
    size_t limit = s->slot_count + 16, count; /* any further orphans are handled in the next round */
    int64_t *ids = mem_array(limit, sizeof *ids);
    enum job_wanted *wanted = mem_array(limit, sizeof *wanted);
    struct error err;
    if (store_job_running(s->store, limit, ids, wanted, &count, &err) != STATUS_OK) {
        retry_later(s, "cannot read the users' requests", &err);
        count = 0;
    }
    for (size_t i = 0; i < count; i++) {
        struct attempt *a = NULL;
        for (size_t k = 0; k < s->job_slots && !a; k++)
            if (s->slot[k].phase != ATTEMPT_EMPTY && s->slot[k].job_id == ids[i])
                a = &s->slot[k];
        if (!a)
            requeue_orphan(s, ids[i]);
        else if (a->phase == ATTEMPT_ALIVE)
            follow_wish(s, a, wanted[i]);
    }
    mem_free(wanted);
    mem_free(ids);
}

static bool outlives(const struct attempt *a) { return a->run && a->run->outlives; }

static bool any_alive(const struct scheduler *s) {
    for (size_t i = 0; i < s->slot_count; i++)
        if (s->slot[i].phase == ATTEMPT_ALIVE && !(atomic_load(&s->stopping) && outlives(&s->slot[i])))
            return true;
    return false;
}

/* While the disk is nearly full, running jobs are stopped at a checkpoint, and queued jobs give the reason. */
static void watch_disk(struct scheduler *s) {
    struct error err;
    bool changed = disk_check(&s->disk, s->config.data_dir);
    atomic_store(&s->waits_for_disk, s->disk.is_low);
    if (!changed && !s->disk.is_low)
        return;
    s->admission.told_id = s->small_admission.told_id = -1; /* the reason that a job waits is the disk now, or none */
    for (size_t i = 0; s->disk.is_low && i < s->job_slots; i++)
        ask_to_stop(s, &s->slot[i]);
    if (store_job_explain(s->store, 0, s->disk.is_low ? s->disk.reason : "", DISK_REASON,
                          s->disk.is_low ? DISK_HINT : "", &err) != STATUS_OK)
        retry_later(s, "cannot say why jobs wait", &err);
}

/* Kills workers whose time is up; returns how long the loop may sleep. */
static double keep_deadlines(struct scheduler *s) {
    double now = clock_sec(), sleep = s->must_retry ? RETRY_SEC : (double)INFINITY;
    if (any_alive(s) || s->disk.is_low)
        sleep = fmin(sleep, fmax(s->disk.looked_at + DISK_LOOK_SEC - now, 0.01));
    if (s->check_room)
        sleep = fmin(sleep, DISK_LOOK_SEC);
    if (!atomic_load(&s->stopping))
        sleep = fmin(sleep, fmax(fmin(s->housekeeping_at, s->deliveries.due_at) - now, 0.0));
    for (size_t i = 0; i < s->slot_count; i++) {
        struct attempt *a = &s->slot[i];
        if (a->phase != ATTEMPT_ALIVE)
            continue;
        if (a->kill_at_sec > 0.0 && a->kill_at_sec <= now)
            kill_now(a);
        if (a->kill_at_sec > 0.0)
            sleep = fmin(sleep, a->kill_at_sec - now);
    }
    return sleep;
}

unsigned long scheduler_rounds(const struct scheduler *s) { return atomic_load(&s->rounds); }

/* Sleeps until somebody calls, something is heard of a run, or that time is over. */
static void wait_for_something(struct scheduler *s, double sleep) {
    double look;
    nfds_t count = 0;
    atomic_fetch_add(&s->rounds, 1);
    s->poll[count++] = (struct pollfd){.fd = s->wake_fd, .events = POLLIN};
    for (size_t i = 0; i < s->slot_count; i++) {
        const struct attempt *a = &s->slot[i];
        if (a->phase != ATTEMPT_ALIVE)
            continue;
        count += run_poll(a->run, s->poll + count, &look);
        sleep = fmin(sleep, look);
    }
    if (!atomic_load(&s->stopping)) { /* else nobody listens to them */
        count += deliveries_poll(&s->deliveries, s->poll + count, &look);
        sleep = fmin(sleep, look);
    }
    /* Rounded up: rounded down, the loop would spin. A signal ends it early, which is harmless. */
    poll(s->poll, count, isinf(sleep) ? -1 : (int)ceil(sleep * 1000.0));
    uint64_t calls;
    if (s->poll[0].revents && read(s->wake_fd, &calls, sizeof calls) < 0)
        return;
}

static void listen_and_settle(struct scheduler *s) {
    int running = 0;
    for (size_t i = 0; i < s->slot_count; i++) {
        struct attempt *a = &s->slot[i];
        struct error err;
        worker_messages_read(a, s->store, &s->counters);
        bool is_postponed = i >= s->job_slots && outcome_lacks_room(a);
        if (a->phase == ATTEMPT_ENDED && outcome_settle(a, s->store, s->trash, &s->counters, &err) != STATUS_OK)
            retry_later(s, "cannot record how an attempt ended", &err);
        else if (is_postponed)
            postpone_check(s);
        running += a->phase == ATTEMPT_ALIVE;
    }
    atomic_store(&s->running, running);
}

static void keep_house(struct scheduler *s) {
    if (clock_sec() < s->housekeeping_at)
        return;
    housekeeping_run(&s->config, s->store);
    s->housekeeping_at = clock_sec() + HOUSEKEEPING_SEC;
}

enum status scheduler_run(struct scheduler *s, struct error *err) {
    size_t requeued;
    housekeeping_after_kill(&s->config, s->store);
    enum status status = resume_all(s->slot, s->job_slots, &s->places, &s->config, s->store, &requeued, err);
    if (status == STATUS_OK)
        status = store_scene_check_again(s->store, err);
    if (status != STATUS_OK)
        return status;
    if (requeued)
        log_info("%zu jobs that ran when the daemon ended are queued again", requeued);
    measure_unknown(&s->config, s->store);
    for (;;) {
        bool stopping = atomic_load(&s->stopping);
        s->must_retry = false;
        listen_and_settle(s);
        if (stopping) {
            for (size_t i = 0; i < s->slot_count; i++)
                if (!outlives(&s->slot[i]))
                    ask_to_stop(s, &s->slot[i]);
            if (!any_alive(s))
                break;
        } else {
            watch_disk(s);
            start_checks(s);
            start_jobs(s);
            keep_house(s);
            struct error why;
            if (deliveries_run(&s->deliveries, &s->config, s->store, &why) != STATUS_OK)
                retry_later(s, "cannot call a webhook", &why);
        }
        follow_wishes(s);
        wait_for_something(s, keep_deadlines(s));
    }
    (void)store_usage_pay(s->store, NULL);
    deliveries_stop(&s->deliveries, s->store);
    /* Attempts that could not be entered are "running" in the store; the next start queues them again. */
    return STATUS_OK;
}
